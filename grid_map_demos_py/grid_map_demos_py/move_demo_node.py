# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `move_demo`: shows the two ways to change the position of a map, along a spiral.

`move` keeps the data at its place in the world, and data that leaves the map is lost. Setting
`position` takes the data along. Publishes on `grid_map`, 10 times a second.
"""

import numpy as np
from rclpy.node import Node

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Positions
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_serialized_message
from grid_map_ros_py.nodes import map_qos, read_positive, run


def make_map() -> GridMap:
    """Return a map of 70 x 70 cells with random values from -1 to 1."""
    grid_map = GridMap((0.7, 0.7), 0.01, layers=["layer"], frame_id="map")
    grid_map["layer"] = np.random.default_rng().uniform(-1.0, 1.0, grid_map.size)
    return grid_map


def place(seconds: float) -> Positions:
    """Return the position (2,) of the map [m] at a time, on a spiral that starts at the origin."""
    return 0.03 * seconds * np.array([np.cos(seconds), np.sin(seconds)])


class MoveDemoNode(Node):
    """Moves a map along the spiral and publishes it."""

    def __init__(self) -> None:
        super().__init__("move_demo")
        rate = read_positive(self, "publish_rate", 10.0, description="maps per second [Hz]")
        about = "duration of each of the two ways [s]"
        self._duration = read_positive(self, "duration", 10.0, description=about)
        self._original = make_map()
        self._uses_move = False
        self._publisher = self.create_publisher(GridMapMessage, "grid_map", map_qos())
        self._restart()
        self.create_timer(1.0 / rate, self._publish)

    def _restart(self) -> None:
        self._uses_move = not self._uses_move
        way = "move" if self._uses_move else "position"
        self.get_logger().info(f"changes the position of the map with `{way}`")
        self._map = self._original.copy()
        self._start = self.get_clock().now()

    def _publish(self) -> None:
        now = self.get_clock().now()
        seconds = 1e-9 * (now - self._start).nanoseconds
        if self._uses_move:
            self._map.move(place(seconds))
        else:
            self._map.position = place(seconds)
        self._map.timestamp = now.nanoseconds
        self._publisher.publish(to_serialized_message(self._map))
        if seconds > self._duration:
            self._restart()


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(MoveDemoNode)


if __name__ == "__main__":
    raise SystemExit(main())
