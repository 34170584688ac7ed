# SPDX-License-Identifier: BSD-3-Clause
"""Node `planar_regions`: publishes the planar regions of maps as layers, markers and polygons."""

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PolygonStamped
from rclpy.event_handler import PublisherEventCallbacks
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from grid_map_core_py import GridMap
from grid_map_core_py._parameters import mismatch
from grid_map_core_py.errors import GridMapError, MissingPackageError, required
from grid_map_core_py.planes import PlanarRegions, PlaneParameters, extract_planes
from grid_map_core_py.planes._parameters import SECTIONS, UNUSED
from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import ReceivedMap, to_message, to_serialized_message, to_stamp
from .._planes import to_markers, to_polygons, to_terrain
from ..nodes import ConfiguredNode, MapPublisher, MapSubscription, read_parameter_tree
from ..nodes._health import LogThrottle, health_of
from ..nodes._parameters import read_fields

QUEUE = 1000
"""Maximum number of polygons that wait for a subscriber."""


class PlanarRegionsNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__("planar_regions")
        self._log, self._health = LogThrottle(self.get_logger()), health_of(self)
        self._health.drop_level = DiagnosticStatus.ERROR
        topic = self.read_topic("grid_map_topic", "/grid_map", "topic of grid maps")
        about = "layer of heights [m]; a layer `variance`, if present, sets their weights"
        self._layer = self.read("height_layer", "elevation", about)
        if not self._layer:
            raise mismatch("height_layer", "the name of a layer", "")
        sections: dict[str, Any] = {
            name: read_fields(self, cls, f"{name}.") for name, cls in SECTIONS.items()
        }
        self._plane_parameters = PlaneParameters(**sections)
        for name in UNUSED:
            read_parameter_tree(self, name, description="no effect")
        self._latest: tuple[ReceivedMap, PlanarRegions] | None = None
        self._details = {"regions": 0, "ms of the last map": math.nan}
        self._health.details = lambda: self._details
        markers = self._output(
            "planar_regions",
            MarkerArray,
            lambda received, regions: to_markers(regions, _header(received)),
        )
        maps = self._output(
            "planar_map", GridMapMessage, lambda *latest: to_serialized_message(_map(*latest))
        )
        self._outputs = [maps, markers]
        remedy = "build its ROS 2 port in your workspace"
        try:
            package = required("convex_plane_decomposition_msgs.msg", "planar_terrain", remedy)
        except MissingPackageError as error:
            self.get_logger().info(f"{error}. Without it, the node publishes no PlanarTerrain")
        else:

            def make(received: ReceivedMap, regions: PlanarRegions) -> Any:
                return to_terrain(regions, to_message(_map(received, regions)), package)

            self._outputs.append(self._output("planar_terrain", package.PlanarTerrain, make))
        # A latched queue would mix the polygons of several maps.
        events = PublisherEventCallbacks(matched=lambda _: self._publish_polygons())
        self._polygons = self.create_publisher(
            PolygonStamped, "planar_polygons", QUEUE, event_callbacks=events
        )
        self._subscription = MapSubscription(self, topic, self._on_map)
        topics = self._subscription.topic_name, markers.topic_name
        self.get_logger().info("finds the regions of {}, publishes them on {}".format(*topics))

    def _output(self, topic: str, kind: type, make: Callable[..., Any]) -> MapPublisher:
        created = lambda: make(*self._latest) if self._latest else None  # noqa: E731
        return MapPublisher(self, topic, created, self._log, kind=kind)

    def _on_map(self, received: ReceivedMap) -> None:
        begin = time.perf_counter()
        if self._layer not in received.layers:
            known = ", ".join(received.layers) or "(none)"
            text = f"no layer {self._layer!r}; available: {known}. Set the parameter height_layer"
            raise GridMapError(text)
        wanted = [name for name in (self._layer, "variance") if name in received.layers]
        grid_map = received.decode(wanted, copy=False)
        previous = self._latest[1] if self._latest else None
        if previous is not None and not previous.fits(grid_map):
            new = f"{grid_map.frame_id!r} with cells of {grid_map.resolution:g} m"
            self._log.warning(f"the map has changed to {new}: ids start again at 1")
            previous = None
        regions = extract_planes(grid_map, self._layer, self._plane_parameters, previous)
        self._latest = received, regions
        self._details["regions"] = len(regions)
        self._details["ms of the last map"] = round(1e3 * (time.perf_counter() - begin), 1)
        self._health.problem = ""
        if not len(regions):
            count = int(np.isfinite(regions.planarity).sum())
            text = f"no planar regions on {self._subscription.topic_name}: layer {self._layer!r} "
            self._health.problem = f"{text}has {count} known cells. Check the thresholds"
            self._log.warning(self._health.problem)
        for output in self._outputs:
            output.publish()
        self._publish_polygons()

    def _publish_polygons(self) -> None:
        if self._latest and self._polygons.get_subscription_count():
            received, regions = self._latest
            for message in to_polygons(regions, _header(received)):
                self._polygons.publish(message)


def _map(received: ReceivedMap, regions: PlanarRegions) -> GridMap:
    return received.decode(copy=False).with_layers(regions.layers())


def _header(received: ReceivedMap) -> Header:
    return Header(stamp=to_stamp(received.timestamp), frame_id=received.frame_id)


if __name__ == "__main__":
    raise SystemExit(PlanarRegionsNode.main())
