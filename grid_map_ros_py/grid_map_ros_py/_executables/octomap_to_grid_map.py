# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `octomap_to_grid_map`: publishes the surface of an OctoMap as a map."""

import math
import sys
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from grid_map_core_py.errors import GridMapError
from grid_map_msgs.msg import GridMap as GridMapMessage

from ..messages._grid_map import to_serialized_message
from ..messages._octomap import from_octomap
from ..messages._packages import messages_of
from ..nodes._parameters import check_topic, read_parameter, read_positive
from ..nodes._qos import map_qos
from ..nodes._spin import run
from ..nodes._subscription import LatchedSubscription
from ..nodes._throttle import LogThrottle

NAME = "octomap_to_grid_map"


class OctomapToGridMapNode(Node):
    """Converts every octomap of a topic or a service."""

    def __init__(self) -> None:
        super().__init__(NAME)
        self._throttle = LogThrottle()
        topic = _read_topic(self, "grid_map_topic", "/grid_map", "topic of the map")
        about = "name of the layer of heights"
        self._layer = read_parameter(self, "layer", str, "elevation", description=about)
        about = "side of a cell [m]; 0 means the side of a voxel"
        self._resolution = read_parameter(self, "resolution", float, 0.0, description=about) or None
        self._min_bound = _read_bound(self, "min", "less")
        self._max_bound = _read_bound(self, "max", "more")
        self._publisher = self.create_publisher(GridMapMessage, topic, map_qos())
        source = self._listen()
        self.get_logger().info(f"publishes the octomaps of {source} on {topic}")

    def _listen(self) -> str:
        """Subscribe, or call the service periodically; return the name of topic or service."""
        about = "topic of the octomaps, binary or full"
        topic = _read_topic(self, "octomap_topic", "/octomap_binary", about)
        about = "service `octomap_msgs/GetOctomap` to call instead; empty uses the topic"
        service = read_parameter(self, "octomap_service_topic", str, "", description=about)
        about = "time between two calls of the service [s]"
        period = read_positive(self, "octomap_service_period", 10.0, description=about)
        if not service:
            octomap = messages_of("octomap_msgs", NAME).Octomap
            self._subscription = LatchedSubscription(self, octomap, topic, self._receive)
            return topic
        check_topic(self, "octomap_service_topic", service)
        self._service = messages_of("octomap_msgs", NAME, "srv").GetOctomap
        self._client = self.create_client(self._service, service)
        self._answer: Any = None
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(period, self._ask, clock=steady)
        # The service may start after the node.
        self._first = self.create_timer(min(1.0, period), self._ask_first, clock=steady)
        return service

    def _ask_first(self) -> None:
        if self._client.service_is_ready():
            self._first.cancel()
        self._ask()

    def _ask(self) -> None:
        if not self._client.service_is_ready():
            self._warn(f"the service {self._client.srv_name} is not there")
        elif self._answer is None or self._answer.done():
            self._answer = self._client.call_async(self._service.Request())
            self._answer.add_done_callback(self._receive_answer)

    def _receive_answer(self, answer: Any) -> None:
        if answer.exception() is not None:
            self._warn(f"the service {self._client.srv_name} failed: {answer.exception()}")
        else:
            self._receive(answer.result().map)

    def _receive(self, message: Any) -> None:
        try:
            grid_map = from_octomap(
                message,
                self._layer,
                self._resolution,
                min_bound=self._min_bound,
                max_bound=self._max_bound,
            )
            grid_map.basic_layers = [self._layer]
            self._publisher.publish(to_serialized_message(grid_map))
        except GridMapError as error:
            self._warn(f"cannot use the octomap: {error}")

    def _warn(self, text: str) -> None:
        if self._throttle.allow(text):
            self.get_logger().warning(text)


def _read_topic(node: Node, name: str, default: str, description: str) -> str:
    topic = read_parameter(node, name, str, default, description=description)
    return check_topic(node, name, topic)


def _read_bound(node: Node, end: str, beyond: str) -> list[float]:
    """Return the bounds at one end of the three axes; NaN means no bound."""
    about = "voxels whose center has {} {} are left out [m]; `.nan` means no bound"
    return [
        read_parameter(
            node, f"{end}_{axis}", float, math.nan, description=about.format(beyond, axis)
        )
        for axis in "xyz"
    ]


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(OctomapToGridMapNode)


if __name__ == "__main__":
    sys.exit(main())
