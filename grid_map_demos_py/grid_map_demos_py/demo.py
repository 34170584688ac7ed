# SPDX-License-Identifier: BSD-3-Clause
"""Base class of demo nodes."""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from rclpy.publisher import Publisher

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_serialized_message
from grid_map_ros_py.nodes import ConfiguredNode, map_qos


class Demo(ConfiguredNode):
    """Node with helper methods for file paths and for publishing maps."""

    def read_path(self, name: str, default: str, description: str, *, data: str = "") -> Path:
        """Return a path parameter with `~` expanded; if empty, the demo data file `data`."""
        given = self.read(name, default, description)
        if data and not given:
            return Path(get_package_share_directory("grid_map_demos_py"), "data", data)
        # `Path.expanduser` would raise an error for an unknown user.
        return Path(os.path.expanduser(given))  # noqa: PTH111

    def map_publisher(self, topic: str = "grid_map") -> Publisher:
        """Create a latched map publisher."""
        return self.create_publisher(GridMapMessage, topic, map_qos())

    def publish_maps(self, default_rate: float, topic: str = "grid_map") -> None:
        """Publish the maps of `map_at` at the rate of the parameter `publish_rate`."""
        rate = self.read_positive("publish_rate", default_rate, "maps per second [Hz]")
        publisher = self.map_publisher(topic)

        def publish() -> None:
            now = self.get_clock().now().nanoseconds
            grid_map = self.map_at(1e-9 * now)
            grid_map.timestamp = now
            publisher.publish(to_serialized_message(grid_map))
            self.get_logger().info(f"publishes {grid_map} on {publisher.topic_name}", once=True)

        self.create_timer(1.0 / rate, publish)
        publish()

    def map_at(self, seconds: float) -> GridMap:
        """Return the map to publish at a time [s]."""
        raise NotImplementedError
