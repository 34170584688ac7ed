# SPDX-License-Identifier: BSD-3-Clause
"""Node `costmap`: publishes a cost layer for Nav2, as full grids and as updates."""

import time
from collections import deque
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from nav_msgs.msg import OccupancyGrid
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import Header

from grid_map_core_py._packages import remedy_for
from grid_map_core_py.conversions import CostRange
from grid_map_core_py.conversions._costmap import UNKNOWN
from grid_map_core_py.errors import GridMapError, MissingPackageError
from grid_map_core_py.plugins import check

from .. import ReceivedMap, to_costmap, to_occupancy_grid
from .._costs import WORST_BELOW_UNKNOWN, Planar, aligned, check_costs, planar, resampled
from ..errors import DROPPED, reason
from ..messages._packages import messages_of
from ..messages._updates import filled, is_same_grid, with_cells
from ..nodes import ConfiguredNode, MapSubscription, map_qos
from ..nodes._health import LogThrottle, dropping, health_of
from ..nodes._parameters import follow_changes, read_fields
from ..nodes._poses import PACKAGE as TF, TfPoses, frame_name, has_tf
from ..nodes._scans import WAIT_PERIOD
from ..nodes._spin import steady_timer

PATIENCE, QUEUE = 1.0, 10
"""Maximum time to wait for a transform [s]; maximum number of waiting maps and latched updates."""


@dataclass(frozen=True, kw_only=True)
class CostmapSettings:
    """Parameters of the `costmap` node that can be changed while it runs.

    Attributes:
        layer: layer with integer costs from 0 to 254; NaN means unknown.
        frame_id: frame of the costmap; empty means the frame of the grid map. Other frames require
            tf2.
        resolution: cell size of the costmap [m]; 0 means the cell size of the map.
        origin_grid: the map is cropped so that its borders are multiples of this number of cells
            from the frame origin. With a larger number, a moving map requires fewer full grids.
        unknown: rank of unknown map cells where a costmap cell gets the worst of several map
            cells. `worst`: worse than every cost. `above_free`: worse than cost 0 only.
        stale_after: time without a usable map after which all cells become unknown [s]; 0 means
            never.
        always_send_full: send only full grids.
    """

    layer: str = "cost"
    frame_id: str = ""
    resolution: float = 0.0
    origin_grid: int = 1
    unknown: Literal["worst", "above_free"] = "worst"
    stale_after: float = 10.0
    always_send_full: bool = False

    def __post_init__(self) -> None:
        for name, least in (("origin_grid", 1), ("stale_after", 0)):
            value = getattr(self, name)
            check(least <= value < np.inf, name, f"at least {least}", value)
        fits = self.resolution == 0 or 1e-9 <= self.resolution <= 1e9
        check(fits, "resolution", "0, or a number from 1e-09 to 1e+09", self.resolution)


class Output:
    """Publisher of full grids of type `kind`, and of updates if `update` is not None.

    Both topics are latched, so a late subscriber may apply an old update to a newer full grid. Two
    measures limit such errors: an update expires after `period` [s], and two full grids follow each
    update, one per period.
    """

    def __init__(self, node: Node, topic: str, kind: type, update: Any, period: float) -> None:
        self.last: Any = None
        self.counts = {"full grids": 0, "updates": 0}
        self._node, self._update, self._pending = node, update, 0
        self._publisher = node.create_publisher(kind, topic, map_qos())
        qos = map_qos()
        qos.depth, qos.lifespan = QUEUE, Duration(seconds=period)
        self._offer_updates = partial(node.create_publisher, update, f"{topic}_updates", qos)
        self._updates: Any = update and self._offer_updates()
        steady_timer(node, period, self._repeat)

    def send(self, grid: Any, *, full: bool = False) -> None:
        """Send a full grid, an update, or nothing if no cell has changed."""
        before, self.last = self.last, grid
        is_new = full or before is None or not is_same_grid(before, grid)
        if is_new or (not self._update and before.data != grid.data):
            self._send_full()
        elif self._update and (update := filled(self._update(), before, grid)):
            self._updates.publish(update)
            self.counts["updates"] += 1
            self._pending = 2

    def send_unknown(self, stamp: Time) -> None:
        """If a grid was sent before, discard latched updates and send a grid of unknown cells."""
        if self.last is None:
            return
        if self._update:
            self._node.destroy_publisher(self._updates)
            self._updates = self._offer_updates()
        header = Header(stamp=stamp, frame_id=self.last.header.frame_id)
        cells = np.full(len(self.last.data), UNKNOWN, np.uint8)
        self.send(with_cells(self.last, cells, header), full=True)

    def _repeat(self) -> None:
        if self._pending:
            self._pending -= 1
            self._send_full()

    def _send_full(self) -> None:
        self._publisher.publish(self.last)
        self.counts["full grids"] += 1


class CostmapNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__("costmap")
        self._log, self._health = LogThrottle(self.get_logger()), health_of(self)
        self._health.drop_level = DiagnosticStatus.ERROR
        self._map_topic = self.read_topic("grid_map_topic", "/grid_map", "topic of grid maps")
        topic = self.read_topic("costmap_topic", "costmap", "topic of the occupancy grids")
        publishes_raw = self.read("publish_raw", True, "also publish `nav2_msgs/Costmap`")
        about = "maximum time from an update to the next full grid [s]"
        period = 0.5 * self.read_number("full_period", 5.0, 0.01, 1e6, about)
        self._settings = read_fields(self, CostmapSettings, read_only=False)
        update = getattr(self._find("map_msgs", "full grids only"), "OccupancyGridUpdate", None)
        self._outputs = [Output(self, topic, OccupancyGrid, update, period)]
        self._health.details = lambda: self._outputs[0].counts
        if publishes_raw and (nav2 := self._find("nav2_msgs", "no nav2_msgs/Costmap")):
            raw = Output(self, f"{topic}_raw", nav2.Costmap, nav2.CostmapUpdate, period)
            self._outputs.append(raw)
            service = messages_of("nav2_msgs", "costmap", "srv").GetCostmap
            folder, slash, name = topic.rpartition("/")
            self.create_service(service, f"{folder}{slash}get_{name}", self._answer)
        self._waiting: deque[tuple[ReceivedMap, float]] = deque()
        self._used, self._is_stale = time.monotonic(), False
        self._listen()
        follow_changes(self, self._settings, self._apply)
        steady_timer(self, WAIT_PERIOD, self._work)
        source, target = self._subscription.topic_name, self.resolve_topic_name(topic)
        self.get_logger().info(
            f"publishes {self._settings.layer!r} of {source} on {target}. Set trinary_costmap to "
            "false and subscribe_to_updates to true in the StaticLayer of Nav2"
        )

    def _find(self, package: str, consequence: str) -> Any:
        try:
            return messages_of(package, "costmap")
        except MissingPackageError as error:
            self.get_logger().info(f"{error}. Without it, the node publishes {consequence}")
            return None

    def _answer(self, _request: Any, response: Any) -> Any:
        if self._outputs[-1].last is None:
            topic = self._subscription.topic_name
            self._log.warning(f"get_costmap: no costs yet, as no map of {topic} has been used")
        else:
            response.map = self._outputs[-1].last
        return response

    # --- parameters -------------------------------------------------------------------------------

    def _apply(self, settings: CostmapSettings) -> None:
        """Use the changed settings for later maps, and request a latched map again."""
        before, self._settings = self._settings, settings
        self._waiting.clear()
        self._subscription.destroy()
        self._listen(is_moved=before.frame_id != settings.frame_id)

    def _listen(self, *, is_moved: bool = True) -> None:
        frame_id = self._settings.frame_id
        if is_moved:
            self._poses = TfPoses(self, frame_id) if frame_id and has_tf() else None
        self._subscription = MapSubscription(self, self._map_topic, self._on_map)

    # --- maps -------------------------------------------------------------------------------------

    def _on_map(self, received: ReceivedMap) -> None:
        transform = self._transform(received)
        if transform is not None:
            self._waiting.clear()
            self._send(received, transform)
            return
        if len(self._waiting) == QUEUE:
            # Keep the oldest map, so that its missing transform is logged.
            self._waiting.pop()
        self._waiting.append((received, time.monotonic()))
        self._health.defer()

    def _transform(self, received: ReceivedMap, since: float = np.inf) -> Planar | None:
        """Return the pose of the map in the costmap frame, or None if it is not known yet."""
        source, target = frame_name(received.frame_id), frame_name(self._settings.frame_id)
        if target in ("", source):
            return 0.0, 0.0, 0.0
        if self._poses is None:
            need = f"the costmap in frame {target!r} of a map in frame {source!r}"
            remedy = f"{remedy_for('tf2_ros')}, or leave frame_id empty"
            raise MissingPackageError(TF, need, remedy)
        matrix = self._poses.frame_at(source, received.timestamp)
        if matrix is None and time.monotonic() - since > PATIENCE:
            raise GridMapError(
                f"frame_id: expected a transform from {source!r} to {target!r}, got none within "
                f"{PATIENCE:g} s: {self._poses.waits_for}. Publish it on /tf"
            )
        return None if matrix is None else planar(matrix, source, target)

    def _send(self, received: ReceivedMap, transform: Planar) -> None:
        settings, layer = self._settings, self._settings.layer
        grid_map = received.decode([layer], copy=False)
        check_costs(grid_map, layer)
        frame_id = frame_name(settings.frame_id) or grid_map.frame_id
        target = frame_id, settings.resolution or grid_map.resolution
        worst_below_unknown = WORST_BELOW_UNKNOWN[settings.unknown]
        grid_map = resampled(grid_map, layer, transform, *target, worst_below_unknown)
        grid_map = aligned(grid_map, settings.origin_grid)
        full = settings.always_send_full or self._is_stale
        self._outputs[0].send(to_occupancy_grid(grid_map, layer, codec=CostRange()), full=full)
        for raw in self._outputs[1:]:
            raw.send(to_costmap(grid_map, layer), full=full)
        self._used, self._is_stale, self._health.problem = time.monotonic(), False, ""

    def _work(self) -> None:
        """Send waiting maps whose transforms are known; mark outdated costs as unknown."""
        while self._waiting and self._finish(*self._waiting[0]):
            self._waiting.popleft()
        limit = self._settings.stale_after
        if limit and time.monotonic() - self._used > limit and not self._is_stale:
            self._is_stale, topic = True, self._subscription.topic_name
            text = f"no usable map of {topic} for {limit:g} s, so all cells are unknown"
            self._health.problem = text
            self._log.warning(f"{text}; set stale_after to 0 for a map that is published once")
            for output in self._outputs:
                output.send_unknown(self.get_clock().now().to_msg())

    def _finish(self, received: ReceivedMap, since: float) -> bool:
        """Send or drop a waiting map; return False if it must keep waiting."""
        with dropping(self._log, f"dropped a message of {self._subscription.topic_name}"):
            try:
                transform = self._transform(received, since)
                if transform is None:
                    return False
                self._send(received, transform)
            except DROPPED as error:
                self._health.drop(reason(error))
                raise
            self._health.use()
        return True


if __name__ == "__main__":
    raise SystemExit(CostmapNode.main())
