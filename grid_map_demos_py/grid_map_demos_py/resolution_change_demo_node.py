# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `resolution_change_demo`: changes the resolution of a map between 1 cm and 9 cm.

OpenCV resizes the layers like images. Publishes `grid_map` with the layer `elevation`, a star.
"""

import math

import cv2
from rclpy.node import Node

from grid_map_core_py.conversions import change_resolution
from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_serialized_message
from grid_map_ros_py.nodes import map_qos, read_parameter, read_positive, run

from .star import star_map

INTERPOLATIONS = {
    "nearest": cv2.INTER_NEAREST,
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "area": cv2.INTER_AREA,
    "lanczos": cv2.INTER_LANCZOS4,
}


def resolution_at(seconds: float) -> float:
    """Return the side of a cell [m] at a time: from 0.01 to 0.09 and back in 2 pi s."""
    return 0.05 + 0.04 * math.sin(seconds)


class ResolutionChangeDemoNode(Node):
    """Publishes the star at the current resolution."""

    def __init__(self) -> None:
        super().__init__("resolution_change_demo")
        about = "cells around the star have no value"
        transparent = read_parameter(self, "use_transparency", bool, False, description=about)
        about = "interpolation method: " + ", ".join(INTERPOLATIONS)
        name = read_parameter(self, "interpolation", str, "cubic", description=about)
        check(name in INTERPOLATIONS, "interpolation", f"one of {[*INTERPOLATIONS]}", name)
        rate = read_positive(self, "publish_rate", 10.0, description="maps per second [Hz]")
        self._interpolation = INTERPOLATIONS[name]
        self._map = star_map("elevation", 0.03, has_ground=not transparent)
        self._publisher = self.create_publisher(GridMapMessage, "grid_map", map_qos())
        rows, columns = self._map.size
        self.get_logger().info(f"scales {rows} x {columns} cells on {self._publisher.topic_name}")
        self.create_timer(1.0 / rate, self._publish)

    def _publish(self) -> None:
        now = self.get_clock().now().nanoseconds
        scaled = change_resolution(self._map, resolution_at(1e-9 * now), self._interpolation)
        scaled.timestamp = now
        self._publisher.publish(to_serialized_message(scaled))


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(ResolutionChangeDemoNode)


if __name__ == "__main__":
    raise SystemExit(main())
