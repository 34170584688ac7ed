# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_terrain`: publishes real ground with holes, again and again.

Parameters:
    topic: where the map goes (`/grid_map`).
    file: the elevation model, an .npz file; empty for the one that is installed with this package.
    resolution: side of a cell [m] (0.03).
    frame_id: coordinate frame of the map (`map`).
    publish_rate: maps per second [Hz] (1.0).
"""

import sys
from pathlib import Path

from rclpy.node import Node

from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_serialized_message
from grid_map_ros_py.parameters import check_topic, read_parameter, read_positive
from grid_map_ros_py.qos import map_qos
from grid_map_ros_py.spin import run

from .share import share
from .terrain import load_terrain


class TerrainPublisherNode(Node):
    """Publishes the same terrain with the time of the moment."""

    def __init__(self) -> None:
        super().__init__("grid_map_terrain")
        file = read_parameter(self, "file", str, "")
        self._map = load_terrain(
            Path(file) if file else share("data", "jacksboro_fault_dem.npz"),
            read_positive(self, "resolution", 0.03),
            frame_id=read_parameter(self, "frame_id", str, "map"),
        )
        topic = check_topic(self, "topic", read_parameter(self, "topic", str, "/grid_map"))
        self._publisher = self.create_publisher(GridMapMessage, topic, map_qos())
        self.create_timer(1.0 / read_positive(self, "publish_rate", 1.0), self._publish)
        self._publish()

    def _publish(self) -> None:
        self._map.timestamp = self.get_clock().now().nanoseconds
        self._publisher.publish(to_serialized_message(self._map))


def main() -> int:
    """Run the node until it is told to stop; return the exit code."""
    return run(TerrainPublisherNode)


if __name__ == "__main__":
    sys.exit(main())
