# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Publish one map on /grid_map and keep it for late subscribers."""

import sys

import numpy as np
from rclpy.node import Node

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_message
from grid_map_ros_py.nodes import map_qos, run


class Publisher(Node):
    def __init__(self) -> None:
        super().__init__("publisher")
        grid_map = GridMap((2.0, 1.5), 0.5, (3.0, 4.0), frame_id="odom", timestamp=5_000_000_006)
        grid_map["elevation"] = np.arange(12).reshape(4, 3)
        grid_map.move((4.0, 4.0))
        self.publisher = self.create_publisher(GridMapMessage, "/grid_map", map_qos())
        self.publisher.publish(to_message(grid_map))
        print("published", flush=True)


if __name__ == "__main__":
    sys.exit(run(Publisher))
