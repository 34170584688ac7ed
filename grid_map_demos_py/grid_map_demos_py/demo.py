# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Base class of the nodes of demos."""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar, TypeVar

from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rclpy.publisher import Publisher

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_serialized_message
from grid_map_ros_py.nodes import map_qos, read_parameter, read_positive, read_topic, run

T = TypeVar("T")


class Demo(Node):
    """A node that reads its parameters in `__init__`, and publishes maps or subscribes to them.

    Attributes:
        NODE_NAME: name of the node; parameter files use it.
    """

    NODE_NAME: ClassVar[str]

    def __init__(self) -> None:
        super().__init__(self.NODE_NAME)

    @classmethod
    def main(cls) -> int:
        """Run the node until an interrupt or a shutdown; return the exit code."""
        return run(cls)

    def read(self, name: str, default: T, description: str) -> T:
        """Return a parameter, which has the type of its default."""
        return read_parameter(self, name, type(default), default, description=description)

    def read_positive(self, name: str, default: float, description: str) -> float:
        """Return a parameter that is a positive number."""
        return read_positive(self, name, default, description=description)

    def read_choice(self, name: str, choices: Iterable[str], default: str, description: str) -> str:
        """Return a parameter that is one of the choices."""
        names = ", ".join(choices)
        value = self.read(name, default, f"{description}: {names}")
        check(value in choices, name, f"one of {names}", value)
        return value

    def read_topic(self, name: str, default: str, description: str) -> str:
        """Return a parameter that names a topic or a service."""
        return read_topic(self, name, default, description=description)

    def read_path(self, name: str, default: str, description: str, *, data: str = "") -> Path:
        """Return a parameter that is a path; an empty one means a file in `data` of this package.

        A leading `~` is expanded.
        """
        given = self.read(name, default, description)
        if data and not given:
            return Path(get_package_share_directory("grid_map_demos_py"), "data", data)
        # `Path.expanduser` would raise an error for an unknown user.
        return Path(os.path.expanduser(given))  # noqa: PTH111

    def map_publisher(self, topic: str = "grid_map") -> Publisher:
        """Return a latched publisher of maps."""
        return self.create_publisher(GridMapMessage, topic, map_qos())

    def publish_maps(self, default_rate: float, topic: str = "grid_map") -> None:
        """Publish `map_at` of the current time, at the rate of the parameter `publish_rate`."""
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
