# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_window`: publishes the part of a large map that surrounds a robot.

The large map is a Zarr store, or one or more GeoTIFF files; only the cells in the window are read.
With `write_back`, maps from a topic are merged into the Zarr store while the robot drives.
"""

import math
import re
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
from rclpy.node import Node

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py._arrays._checks import select_layers
from grid_map_core_py._parameters import mismatch
from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_core_py.limits import check_cells

from .. import ReceivedMap, to_serialized_message
from .._serving import LatestOnly, read_source, window
from ..errors import MessageError, reason
from ..nodes import ConfiguredNode, MapPublisher, MapSubscription, read_parameter
from ..nodes._health import LogThrottle, dropping, health_of
from ..nodes._poses import POSE_TYPES, PoseHistory, TfPoses, chosen_source, subscribe_to_poses
from ..nodes._spin import steady_timer

POSE_SOURCES = ("auto", "tf", *POSE_TYPES)

SILENCE = 3.0
"""Time after startup from which the node warns if it has not received a pose [s]."""

PATIENCE = 20.0
"""Maximum time to write the last map when the node ends [s]."""


class GridMapWindowNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__("grid_map_window")
        self._log = LogThrottle(self.get_logger())
        self._health = health_of(self)
        self._health.details = self._details
        open_source = read_source(self, "required")
        layers = read_parameter(
            self, "layers", list[str], [], description="layers of the window; empty means all"
        )
        length = self.read_positive("length", 20.0, "side length of the window [m]")
        about = "distance that the robot must move before the next window [m]"
        self._step = self.read_number("step", 0.5, 0.0, 1e9, about)
        self._period = 1 / self.read_positive("rate", 10.0, "maximum publication rate [Hz]")
        about = (
            "source of the robot poses: `tf`, `odometry`, `pose` or `pose_with_covariance`; "
            "`auto` means `tf` if tf2 is installed, else `odometry`"
        )
        source = self.read_choice("pose_source", POSE_SOURCES, "auto", about)
        source = chosen_source(source, "odometry")
        about = "topic of the robot poses in the map frame; not used with tf"
        pose_topic = self.read_topic("pose_topic", "/odom", about)
        robot_frame = self.read("robot_frame", "base_link", "frame of the robot; used with tf")
        topic = self.read_topic("output_topic", "/grid_map", "topic of the window")
        about = "merge maps from `write_topic` into the source, which must be a Zarr store"
        writes = self.read("write_back", False, about)
        write_topic = self.read_topic("write_topic", "/elevation_map", "topic of the maps to merge")

        if open_source is None:
            raise mismatch("source", "a Zarr store or a GeoTIFF file", "")
        self._whole = open_source()
        self._layers = select_layers(self._whole.layers, layers or None)
        self._size = GridGeometry((length, length), self._whole.resolution).size
        check_cells("length", self._size, len(self._layers))
        self._poses: PoseHistory | TfPoses
        if source == "tf":
            self._poses = TfPoses(self, self._whole.frame_id, robot_frame)
        else:
            self._poses = history = PoseHistory(self._whole.frame_id, limit=1)
            subscribe_to_poses(self, POSE_TYPES[source], pose_topic, history, self._work, self._log)
        self._center: npt.NDArray[np.float64] | None = None
        self._has_new_cells, self._next, self._start = False, -math.inf, time.monotonic()
        self._milliseconds = math.nan
        self._publisher = MapPublisher(self, topic, self._window, self._log)
        self._writer: LatestOnly[ReceivedMap] | None = None
        if writes:
            if self.resolve_topic_name(write_topic) == self._publisher.topic_name:
                raise ConfigError(f"write_topic and output_topic are both {write_topic!r}")
            # Writing a NaN cell does not change the store, but reveals errors at startup.
            first = self._whole.geometry.cropped(slice(0, 1), slice(0, 1))
            layer, frame_id = self._layers[0], self._whole.frame_id
            self._whole.write(GridMap.from_geometry(first, [layer], frame_id=frame_id))
            self._writer = LatestOnly(self._merge)
            self._subscription = MapSubscription(self, write_topic, self._put)
        # Check more often than `rate`, because a pose may arrive just after a check.
        steady_timer(self, 0.25 * self._period, self._work)
        rows, columns = self._whole.size
        self.get_logger().info(
            f"publishes {self._size[0]} x {self._size[1]} of {rows} x {columns} cells on "
            f"{self._publisher.topic_name}, in the frame {self._whole.frame_id!r}"
        )

    # --- windows ----------------------------------------------------------------------------------

    def _work(self) -> None:
        """Publish a window if the robot has moved or maps were merged, at most at `rate`."""
        self._note_merged()
        found, now = self._poses.latest(), time.monotonic()
        if found is None:
            if now > self._start + SILENCE:
                self._note_problem(f"waits for {self._poses.waits_for}")
            return
        center = self._center
        way = math.inf if center is None else float(np.hypot(*(found[0][:2, 3] - center)))
        if (self._has_new_cells or way > self._step) and now >= self._next:
            self._next = max(self._next + self._period, now)
            self._publisher.publish()

    def _window(self) -> bytes | None:
        found = self._poses.latest()
        if found is None:
            return None
        begin, position = time.perf_counter(), found[0][:2, 3]
        try:
            grid_map = window(self._whole, position, self._size, self._layers)
        except GridMapError as error:
            self._health.problem = f"no window: {error}"
            raise
        grid_map.timestamp = found[1]
        data = to_serialized_message(grid_map)
        self._milliseconds = 1e3 * (time.perf_counter() - begin)
        self._center, self._has_new_cells = position, False
        self._health.problem = ""
        if not self._whole.geometry.contains((position[0], position[1])):
            place = self._whole.geometry.place
            self._note_problem(f"the robot is off the map: it is at {position}; {place}")
        return data

    def _note_problem(self, text: str) -> None:
        self._health.problem = text
        self._log.warning(text)

    # --- maps to merge ----------------------------------------------------------------------------

    def _put(self, received: ReceivedMap) -> None:
        if self._writer:
            self._writer.put(received)
            self._health.defer()

    def _merge(self, received: ReceivedMap) -> None:
        """Merge a received map into the store; runs in the writer thread."""
        # Ignore layers that the store does not contain.
        known = [name for name in received.layers if name in self._whole.layers]
        if not known:
            raise MessageError("layers", f"one of {list(self._whole.layers)}", received.layers)
        self._whole.write(received.decode(known))

    def _note_merged(self) -> None:
        for error in self._writer.outcomes() if self._writer else ():
            if error is None:
                self._health.use()
                self._has_new_cells = True
                continue
            with dropping(self._log, f"did not merge a map of {self._subscription.topic_name}"):
                self._health.drop(reason(error))
                raise error

    def destroy_node(self) -> None:
        """Merge the last received map and destroy the node."""
        if self._writer and not self._writer.close(PATIENCE):
            self.get_logger().error(f"did not merge the last map within {PATIENCE:g} s")
        self._note_merged()
        Node.destroy_node(self)

    def _details(self) -> Mapping[str, object]:
        status = Path("/proc/self/status").read_text()
        sizes = {name: int(size) for name, size in re.findall(r"(\w+):\s+(\d+) kB", status)}
        return {
            "windows": self._publisher.count,
            "ms of the last window": f"{self._milliseconds:.1f}",
            # Excludes the shared memory of Fast DDS, whose size is fixed.
            "resident memory [MB]": f"{(sizes['VmRSS'] - sizes['RssShmem']) / 1024:.1f}",
        }


if __name__ == "__main__":
    raise SystemExit(GridMapWindowNode.main())
