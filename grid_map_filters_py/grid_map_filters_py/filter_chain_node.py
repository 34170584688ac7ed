# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_filters`: runs a filter chain on every map of a topic.

Parameters:
    input_topic: maps come from here (`/grid_map`).
    output_topic: filtered maps go there (`/filtered_map`).
    filter_chain_parameter_name: which parameter holds the chain (`filters`).

Besides the map it publishes `diagnostic_msgs/DiagnosticArray` on `/diagnostics` while somebody
listens: maps in, out and dropped, and the milliseconds of the last map, in all and by filter.
"""

import sys
import warnings
from dataclasses import dataclass, field

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from grid_map_core_py import GridMap
from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, to_message
from grid_map_ros_py.parameters import read_parameter, read_parameter_tree
from grid_map_ros_py.qos import map_qos
from grid_map_ros_py.spin import run
from grid_map_ros_py.subscription import MapSubscription
from grid_map_ros_py.throttle import LogThrottle

from .chain import FilterChain, Step
from .filter import FilterWarning

NODE_NAME = "grid_map_filters"


@dataclass
class Statistics:
    """What a node has done so far."""

    maps_in: int = 0
    maps_out: int = 0
    maps_dropped: int = 0
    last_was_dropped: bool = False
    milliseconds: dict[str, float] = field(default_factory=dict)
    """Of the last map that was filtered, by filter."""

    def record(self, step: Step, seconds: float) -> None:
        """Remember how long a step took."""
        self.milliseconds[step.config.name] = 1e3 * seconds

    def to_status(self, name: str) -> DiagnosticStatus:
        """Return the statistics as a diagnostic message."""
        values = {
            "maps in": self.maps_in,
            "maps out": self.maps_out,
            "maps dropped": self.maps_dropped,
            "ms": f"{sum(self.milliseconds.values()):.3f}",
            **{f"ms {step}": f"{ms:.3f}" for step, ms in self.milliseconds.items()},
        }
        return DiagnosticStatus(
            level=DiagnosticStatus.WARN if self.last_was_dropped else DiagnosticStatus.OK,
            name=f"{name}: filter chain",
            message=f"{self.maps_dropped} of {self.maps_in} maps dropped",
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )


class FilterChainNode(Node):
    """Subscribes to maps, filters them and publishes the results."""

    def __init__(self) -> None:
        super().__init__(NODE_NAME)
        chain_name = read_parameter(self, "filter_chain_parameter_name", str, "filters")
        self._chain = FilterChain.from_config(read_parameter_tree(self, chain_name))
        self._statistics = Statistics()
        self._throttle = LogThrottle()
        self._publisher = self.create_publisher(
            GridMapMessage, read_parameter(self, "output_topic", str, "/filtered_map"), map_qos()
        )
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        topic = read_parameter(self, "input_topic", str, "/grid_map")
        if self.resolve_topic_name(topic) == self._publisher.topic_name:
            raise ConfigError(f"input_topic and output_topic are both {topic!r}")
        self._subscription = MapSubscription(self, topic, self._on_map)
        self.get_logger().info(f"{self._chain} on {topic}")

    def _on_map(self, message: GridMapMessage) -> None:
        self._statistics.maps_in += 1
        try:
            reply = to_message(self._filter(from_message(message, unwrap=False)))
        except GridMapError as error:
            self._statistics.maps_dropped += 1
            self._statistics.last_was_dropped = True
            text = f"dropped a map: {error}"
            if self._throttle.allow(text):
                self.get_logger().error(text)
        else:
            self._publisher.publish(reply)
            self._statistics.maps_out += 1
            self._statistics.last_was_dropped = False
        self._publish_diagnostics()

    def _filter(self, grid_map: GridMap) -> GridMap:
        self._statistics.milliseconds = {}
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", FilterWarning)
            result = self._chain(grid_map, self._statistics.record)
        for warning in caught:
            text = str(warning.message)
            if self._throttle.allow(text):
                self.get_logger().warning(text)
        return result

    def _publish_diagnostics(self) -> None:
        if self._diagnostics.get_subscription_count() == 0:
            return
        array = DiagnosticArray(status=[self._statistics.to_status(self.get_name())])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def main() -> int:
    """Run the node until it is told to stop; return the exit code."""
    return run(FilterChainNode)


if __name__ == "__main__":
    sys.exit(main())
