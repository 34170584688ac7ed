# SPDX-License-Identifier: BSD-3-Clause
"""Node `planar_regions`: publishes the planar regions of maps as layers, markers and polygons."""

import math
import time
from collections.abc import Callable, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PolygonStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from grid_map_core_py import GridMap
from grid_map_core_py._parameters import cast, descriptions, nested
from grid_map_core_py.errors import GridMapError, MissingPackageError, required
from grid_map_core_py.planes import PlanarRegions, PlaneParameters, extract_planes
from grid_map_core_py.planes._parameters import SECTIONS
from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import ReceivedMap, to_message, to_serialized_message, to_stamp
from .._planes import to_markers, to_polygons, to_terrain
from ..nodes import ConfiguredNode, MapSubscription, read_parameter, read_parameter_tree
from ..nodes._health import LogThrottle, health_of
from ..nodes._parameters import read_fields
from ..nodes._topics import LazyPublisher

TERRAIN = "convex_plane_decomposition_msgs"
"""Package with the message `PlanarTerrain`."""

QUEUE = 1000
"""Maximum number of polygons that wait for a subscriber."""


class PlanarRegionsNode(ConfiguredNode):
    """Extracts the regions of every map, and publishes those results that have subscribers."""

    def __init__(self) -> None:
        super().__init__("planar_regions")
        self._log, self._health = LogThrottle(self.get_logger()), health_of(self)
        self._health.drop_level = DiagnosticStatus.ERROR
        self._map_topic = self.read_topic("grid_map_topic", "/grid_map", "topic of the maps")
        about = "layer of heights [m]; the layer `variance`, if present, weights them"
        read_parameter(self, "height_layer", str, "elevation", description=about, read_only=False)
        for section, cls in SECTIONS.items():
            if descriptions(cls):
                read_fields(self, cls, f"{section}.", read_only=False)
            else:
                about = "parameters of convex_plane_decomposition that have no effect here"
                read_parameter_tree(self, section, description=about, read_only=False)
        names = self.get_parameters_by_prefix("")
        self._names = [name for name in names if name.partition(".")[0] in SECTIONS]
        self._names.append("height_layer")
        self._next = self._settings = self._settings_with({})
        self._latest: tuple[ReceivedMap, PlanarRegions] | None = None
        self._details = {"regions": 0, "ms of the last map": math.nan}
        self._health.details = lambda: self._details
        self._outputs: list[LazyPublisher] = []
        self._offer(GridMapMessage, "planar_map", self._maps)
        self._offer(MarkerArray, "planar_regions", self._markers)
        # A latched queue would mix the polygons of several maps.
        self._offer(PolygonStamped, "planar_polygons", self._polygons, QoSProfile(depth=QUEUE))
        self._offer_terrain()
        self._subscription = MapSubscription(self, self._map_topic, self._on_map)
        self.add_on_set_parameters_callback(self._check_changes)
        self.add_post_set_parameters_callback(self._apply_changes)
        topics = self._subscription.topic_name, self._outputs[1].topic_name
        self.get_logger().info("finds the regions of {}, publishes them on {}".format(*topics))

    def _offer(
        self, kind: type, topic: str, make: Callable[..., list[Any]], qos: QoSProfile | None = None
    ) -> None:
        """Create a publisher of the messages that `make` returns for a map and its regions."""
        messages = lambda: [] if self._latest is None else make(*self._latest)  # noqa: E731
        self._outputs.append(LazyPublisher(self, kind, topic, messages, self._log, qos=qos))

    def _offer_terrain(self) -> None:
        """Create the publisher of `PlanarTerrain` if its package exists."""
        remedy = "build its ROS 2 port in your workspace"
        try:
            package = required(f"{TERRAIN}.msg", "planar_terrain", remedy)
        except MissingPackageError as error:
            self.get_logger().info(f"{error}. Without it, the node publishes no PlanarTerrain")
            return

        def make(received: ReceivedMap, regions: PlanarRegions) -> list[Any]:
            return [to_terrain(regions, to_message(_with_layers(received, regions)), package)]

        self._offer(package.PlanarTerrain, "planar_terrain", make)

    # --- parameters -------------------------------------------------------------------------------

    def _settings_with(self, changes: Mapping[str, object]) -> tuple[str, PlaneParameters]:
        """Return the height layer and the parameters of planes after changes of parameters."""
        values = {name: self.get_parameter(name).value for name in self._names}
        tree = nested(values | {name: changes[name] for name in values if name in changes})
        layer = cast("height_layer", tree.pop("height_layer"), str)
        return layer, PlaneParameters.from_mapping(tree)

    def _check_changes(self, changes: list[Parameter]) -> SetParametersResult:
        try:
            self._next = self._settings_with({change.name: change.value for change in changes})
        except GridMapError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_changes(self, _changes: list[Parameter]) -> None:
        """Apply changed settings; resubscribe to receive a latched map again."""
        if self._next != self._settings:
            self._settings = self._next
            self._subscription.destroy()
            self._subscription = MapSubscription(self, self._map_topic, self._on_map)

    # --- maps -------------------------------------------------------------------------------------

    def _on_map(self, received: ReceivedMap) -> None:
        begin = time.perf_counter()
        layer, parameters = self._settings
        if layer not in received.layers:
            known = ", ".join(received.layers) or "(none)"
            text = f"no layer {layer!r}; available: {known}. Set the parameter height_layer"
            raise GridMapError(text)
        wanted = [name for name in (layer, "variance") if name in received.layers]
        grid_map = received.decode(wanted, copy=False)
        regions = extract_planes(grid_map, layer, parameters, self._previous(grid_map))
        self._latest = received, regions
        self._details["regions"] = len(regions)
        self._details["ms of the last map"] = round(1e3 * (time.perf_counter() - begin), 1)
        self._health.problem = self._problem(grid_map, layer, regions)
        if self._health.problem:
            self._log.warning(self._health.problem)
        for output in self._outputs:
            output.publish()

    def _previous(self, grid_map: GridMap) -> PlanarRegions | None:
        """Return the regions of the last map, unless its frame or resolution differs."""
        if self._latest is None:
            return None
        regions = self._latest[1]
        old = regions.frame, regions.geometry.resolution
        new = grid_map.frame_id, grid_map.resolution
        if old[0] == new[0] and math.isclose(old[1], new[1], rel_tol=1e-6):
            return regions
        text = "the map has changed from {!r}, {:g} m to {!r}, {:g} m: ids start again at 1"
        self._log.warning(text.format(*old, *new))
        return None

    def _problem(self, grid_map: GridMap, layer: str, regions: PlanarRegions) -> str:
        topic = self._subscription.topic_name
        if not len(regions):
            known = int((regions.planarity >= 0).sum())
            text = f"no planar regions on {topic}: layer {layer!r} has {known} known cells"
            return f"{text}. Check the thresholds" if known else text
        if not grid_map.frame_id:
            text = f"no frame on {topic}: viewers cannot show the regions"
            return f"{text}. Set header.frame_id of the maps"
        return ""

    # --- messages ---------------------------------------------------------------------------------

    def _maps(self, received: ReceivedMap, regions: PlanarRegions) -> list[bytes]:
        return [to_serialized_message(_with_layers(received, regions))]

    def _markers(self, received: ReceivedMap, regions: PlanarRegions) -> list[MarkerArray]:
        return [to_markers(regions, _header(received))]

    def _polygons(self, received: ReceivedMap, regions: PlanarRegions) -> list[PolygonStamped]:
        return to_polygons(regions, _header(received))


def _with_layers(received: ReceivedMap, regions: PlanarRegions) -> GridMap:
    return received.decode(copy=False).with_layers(regions.layers())


def _header(received: ReceivedMap) -> Header:
    return Header(stamp=to_stamp(received.timestamp), frame_id=received.frame_id)


if __name__ == "__main__":
    raise SystemExit(PlanarRegionsNode.main())
