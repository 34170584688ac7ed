# SPDX-License-Identifier: BSD-3-Clause
"""Node `costmap`: publishes a layer of costs for Nav2, as full grids and as updates.

With `nav2_msgs`, the node also publishes `nav2_msgs/Costmap` and offers it as the service
`get_<costmap_topic>`. All parameters can be changed while the node runs.
"""

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import OccupancyGrid
from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer

from grid_map_core_py import GridMap
from grid_map_core_py._parameters import build
from grid_map_core_py.conversions import CostRange
from grid_map_core_py.conversions._costmap import UNKNOWN
from grid_map_core_py.errors import GridMapError, MissingPackageError
from grid_map_core_py.plugins import check

from .. import (
    ReceivedMap,
    to_costmap,
    to_costmap_update,
    to_occupancy_grid,
    to_occupancy_grid_update,
)
from .._costs import Planar, aligned, check_costs, planar, resampled
from ..errors import DROPPED, reason
from ..messages._packages import messages_of
from ..messages._updates import is_same_grid, with_cells
from ..nodes import ConfiguredNode, MapSubscription, map_qos
from ..nodes._health import LogThrottle, dropping, health_of
from ..nodes._parameters import check_topic, read_fields
from ..nodes._poses import PACKAGE as TF, TfPoses, has_tf
from ..nodes._spin import steady_timer

NAME = "costmap"

PERIOD = 0.05
"""Time between two checks for transforms of waiting maps and for outdated costs [s]."""

PATIENCE = 1.0
"""Maximum time a map waits for its transform [s]."""

UPDATES = 10
"""Number of latched updates, and maximum number of waiting maps."""


@dataclass(frozen=True, kw_only=True)
class CostmapSettings:
    """Parameters of the node.

    Attributes:
        grid_map_topic: topic of the maps.
        layer: layer with whole costs from 0 to 254; NaN is unknown.
        costmap_topic: topic of the costmap, and start of the names of its other topics.
        frame_id: frame of the costmap; empty means the frame of the map. Another frame needs tf2.
        resolution: cell size of the costmap [m]; 0 means the cell size of the map.
        origin_grid: send the largest window whose borders are multiples of this number of cells,
            so that a moving map needs a full grid less often.
        unknown: rank of unknown cells, if a cell in another frame or resolution touches several
            cells of the map: `worst` of all, or `above_free` but below all other costs.
        stale_after: time without a usable map after which all cells become unknown [s]; 0 means
            never.
        always_send_full: send no updates.
        full_period: maximum time from an update to the next full grid, for late subscribers [s].
        publish_raw: also publish `nav2_msgs/Costmap`, if `nav2_msgs` is installed.
    """

    grid_map_topic: str = "/grid_map"
    layer: str = "cost"
    costmap_topic: str = "costmap"
    frame_id: str = ""
    resolution: float = 0.0
    origin_grid: int = 1
    unknown: Literal["worst", "above_free"] = "worst"
    stale_after: float = 10.0
    always_send_full: bool = False
    full_period: float = 5.0
    publish_raw: bool = True

    def __post_init__(self) -> None:
        check(self.origin_grid >= 1, "origin_grid", "at least 1", self.origin_grid)
        for name in ("resolution", "stale_after"):
            value = getattr(self, name)
            check(0 <= value < np.inf, name, "a number of at least 0", value)
        check(0.01 <= self.full_period <= 1e9, "full_period", "0.01 to 1e9", self.full_period)

    @property
    def outputs(self) -> tuple[object, ...]:
        """Parameters that the publishers depend on."""
        return self.costmap_topic, self.publish_raw, self.full_period


class Output:
    """Latched full grids and their updates.

    An update expires after half of `period` [s], and the full grid follows twice after it, at
    intervals of this time. A late subscriber thus never keeps an update that is older than its
    grid.

    Args:
        node: the node.
        topic: topic of the full grids.
        message_type: class of the full grids.
        update_type: class of the updates; None sends full grids only.
        difference: returns the update between two grids, or None if they are equal.
        period: maximum time from an update to the next full grid [s].
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        message_type: type,
        update_type: type | None,
        difference: Callable[[Any, Any], Any],
        period: float,
    ) -> None:
        self.last: Any = None
        self.full_count = self.update_count = 0
        self._node, self._difference, self._pending = node, difference, 0
        self._publisher = node.create_publisher(message_type, topic, map_qos())
        self._updates: Any = None
        if update_type:
            qos = map_qos()
            qos.depth, qos.lifespan = UPDATES, Duration(seconds=0.5 * period)
            self._updates = node.create_publisher(update_type, f"{topic}_updates", qos)

    def send(self, grid: Any, *, full: bool = False) -> None:
        """Send a full grid, an update, or nothing if no cell has changed."""
        before, self.last = self.last, grid
        if self._updates is None or full or before is None or not is_same_grid(before, grid):
            self._send_full()
        elif update := self._difference(before, grid):
            self._updates.publish(update)
            self.update_count += 1
            self._pending = 2

    def repeat(self) -> None:
        """Send the full grid again if updates may precede it; call this twice per `period`."""
        if self._pending:
            self._pending -= 1
            self._send_full()

    def forget(self) -> None:
        """Send all cells as unknown."""
        if self.last is not None:
            self.last.header.stamp = self._node.get_clock().now().to_msg()
            cells = np.full(len(self.last.data), UNKNOWN, np.uint8)
            self.send(with_cells(self.last, cells, self.last.header), full=True)

    def destroy(self) -> None:
        for publisher in filter(None, (self._publisher, self._updates)):
            self._node.destroy_publisher(publisher)

    def _send_full(self) -> None:
        self._publisher.publish(self.last)
        self.full_count += 1


class CostmapNode(ConfiguredNode):
    """Converts every map to costs in the requested frame, and publishes the changes."""

    def __init__(self) -> None:
        super().__init__(NAME)
        self._log, self._health = LogThrottle(self.get_logger()), health_of(self)
        self._health.details, self._health.drop_level = self._details, DiagnosticStatus.ERROR
        self._next = self._settings = self._checked(read_fields(self, CostmapSettings, read_only=False))
        self._grid_updates = self._find("map_msgs", "sends full grids only")
        self._nav2 = self._find("nav2_msgs", "sends no nav2_msgs/Costmap")
        self._nav2_services = messages_of("nav2_msgs", NAME, "srv") if self._nav2 else None
        self._poses = self._listen_to_tf()
        self._waiting: deque[tuple[ReceivedMap, float]] = deque(maxlen=UPDATES)
        self._used, self._is_stale = time.monotonic(), False
        self._open()
        self._subscription = self._subscribe()
        self.add_on_set_parameters_callback(self._check_changes)
        self.add_post_set_parameters_callback(self._apply_changes)
        steady_timer(self, PERIOD, self._work)
        self.get_logger().info(
            f"publishes the layer {self._settings.layer!r} of {self._subscription.topic_name} on "
            f"{self.resolve_topic_name(self._settings.costmap_topic)}"
        )

    def _find(self, package: str, consequence: str) -> Any:
        try:
            return messages_of(package, NAME)
        except MissingPackageError as error:
            self.get_logger().info(f"{error}. Without it, the node {consequence}")
            return None

    def _listen_to_tf(self) -> TfPoses | None:
        frame_id = self._settings.frame_id
        return TfPoses(self, frame_id) if frame_id and has_tf() else None

    def _subscribe(self) -> MapSubscription:
        return MapSubscription(self, self._settings.grid_map_topic, self._on_map)

    def _open(self) -> None:
        """Create the publishers and the service."""
        settings = self._settings
        topic, period = settings.costmap_topic, settings.full_period
        kind = self._grid_updates and self._grid_updates.OccupancyGridUpdate
        self._grid = Output(self, topic, OccupancyGrid, kind, to_occupancy_grid_update, period)
        self._raw: Output | None = None
        self._service: Any = None
        if self._nav2 and settings.publish_raw:
            kinds = self._nav2.Costmap, self._nav2.CostmapUpdate
            self._raw = Output(self, f"{topic}_raw", *kinds, to_costmap_update, period)
            folder, slash, name = topic.rpartition("/")
            self._service = self.create_service(
                self._nav2_services.GetCostmap, f"{folder}{slash}get_{name}", self._answer
            )
        self._timer: Timer = steady_timer(self, 0.5 * period, self._repeat)

    def _close(self) -> None:
        self.destroy_timer(self._timer)
        if self._service:
            self.destroy_service(self._service)
        for output in self._outputs():
            output.destroy()

    def _outputs(self) -> list[Output]:
        return [self._grid, *([self._raw] if self._raw else [])]

    # --- parameters -------------------------------------------------------------------------------

    def _checked(self, settings: CostmapSettings) -> CostmapSettings:
        for name in ("grid_map_topic", "costmap_topic"):
            check_topic(self, name, getattr(settings, name))
        return settings

    def _check_changes(self, changes: list[Parameter]) -> SetParametersResult:
        """Build the settings with the changed parameters, or reject the change."""
        values = asdict(self._settings)
        values |= {change.name: change.value for change in changes if change.name in values}
        try:
            self._next = self._checked(build(CostmapSettings, values))
        except GridMapError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_changes(self, _changes: list[Parameter]) -> None:
        """Apply the settings to the next map; a latched map arrives again."""
        before, self._settings = self._settings, self._next
        if before == self._settings:
            return
        if before.outputs != self._settings.outputs:
            self._close()
            self._open()
        if before.frame_id != self._settings.frame_id:
            self._poses = self._listen_to_tf()
        self._waiting.clear()
        self._subscription.destroy()
        self._subscription = self._subscribe()

    # --- maps -------------------------------------------------------------------------------------

    def _on_map(self, received: ReceivedMap) -> None:
        transform = self._transform(received)
        if transform is None:
            self._waiting.append((received, time.monotonic()))
        else:
            self._waiting.clear()
            self._send(received, transform)

    def _transform(self, received: ReceivedMap) -> Planar | None:
        """Return the pose of the map in the frame of the costmap, or None if it is not known."""
        source, target = received.frame_id, self._settings.frame_id
        if target in ("", source):
            return Planar()
        if self._poses is None:
            need = f"the costmap in frame {target!r} of a map in frame {source!r}"
            remedy = "install ros-jazzy-tf2-ros-py and source ROS, or leave frame_id empty"
            raise MissingPackageError(TF, need, remedy)
        matrix = self._poses.frame_at(source, received.timestamp)
        return None if matrix is None else planar(matrix, source, target)

    def _send(self, received: ReceivedMap, transform: Planar) -> None:
        settings, layer = self._settings, self._settings.layer
        grid_map = self._costs(received, transform)
        full = settings.always_send_full or self._is_stale
        self._grid.send(to_occupancy_grid(grid_map, layer, codec=CostRange()), full=full)
        if self._raw:
            self._raw.send(to_costmap(grid_map, layer), full=full)
        self._used, self._is_stale, self._health.problem = time.monotonic(), False, ""

    def _costs(self, received: ReceivedMap, transform: Planar) -> GridMap:
        """Return the costs to send, on the grid to send."""
        settings, layer = self._settings, self._settings.layer
        grid_map = received.decode([layer], copy=False)
        check_costs(grid_map, layer)
        frame_id = settings.frame_id or grid_map.frame_id
        resolution = settings.resolution or grid_map.resolution
        if (frame_id, resolution) != (grid_map.frame_id, grid_map.resolution):
            grid_map = resampled(
                grid_map,
                layer,
                transform,
                frame_id,
                resolution,
                unknown_is_worst=settings.unknown == "worst",
            )
        return aligned(grid_map, settings.origin_grid)

    def _work(self) -> None:
        """Send waiting maps whose transform has arrived; make outdated costs unknown."""
        topic, now = self._subscription.topic_name, time.monotonic()
        while self._waiting:
            received, since = self._waiting[0]
            with dropping(self._log, f"dropped a message of {topic}"):
                try:
                    transform = self._transform(received)
                    if transform is None and now - since < PATIENCE:
                        break
                    self._waiting.popleft()
                    if transform is None:
                        raise self._no_transform(received)
                    self._send(received, transform)
                except DROPPED as error:
                    self._health.drop_used(reason(error))
                    raise
        self._forget_outdated()

    def _forget_outdated(self) -> None:
        topic, limit = self._subscription.topic_name, self._settings.stale_after
        now = time.monotonic()
        if limit and now - self._used > limit and not self._is_stale:
            self._is_stale = True
            self._health.problem = (
                f"no usable map of {topic} for {limit:g} s, all cells are unknown; set stale_after "
                "to 0 for a map that is published once"
            )
            self._log.warning(self._health.problem)
            for output in self._outputs():
                output.forget()

    def _no_transform(self, received: ReceivedMap) -> GridMapError:
        source, target = received.frame_id, self._settings.frame_id
        return GridMapError(
            f"frame_id: expected a transform from {source!r} to {target!r}, got none within "
            f"{PATIENCE:g} s: {self._poses and self._poses.waits_for}. Publish it on /tf"
        )

    def _repeat(self) -> None:
        for output in self._outputs():
            output.repeat()

    def _answer(self, _request: Any, response: Any) -> Any:
        if self._raw and self._raw.last is not None:
            response.map = self._raw.last
        return response

    def _details(self) -> Mapping[str, object]:
        return {"full grids": self._grid.full_count, "updates": self._grid.update_count}


if __name__ == "__main__":
    raise SystemExit(CostmapNode.main())
