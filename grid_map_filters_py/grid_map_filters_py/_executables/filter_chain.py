# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_filters`: runs a filter chain on every map of a topic.

The parameters of the chain can be set while the node runs; those above cannot. A new chain is built
first. If that fails, the reason is the answer, and everything stays as it was.

Besides the map it publishes `diagnostic_msgs/DiagnosticArray` on `/diagnostics` while somebody
listens: maps in, out and dropped, why the last one was, and the milliseconds of the last map, of
the mean and of the longest, by filter.
"""

import array
import sys
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter

from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import ReceivedMap, to_serialized_message
from grid_map_ros_py.nodes import (
    LogThrottle,
    MapSubscription,
    check_topic,
    map_qos,
    read_parameter,
    read_parameter_tree,
    read_positive,
    run,
)

from .._chain import FilterChain
from .._config import nested
from .._step_times import StepTimes

NODE_NAME = "grid_map_filters"


@dataclass
class Statistics:
    """Counters of a node."""

    maps_in: int = 0
    maps_out: int = 0
    maps_dropped: int = 0
    last_was_dropped: bool = False
    last_error: str = ""
    times: StepTimes = field(default_factory=StepTimes)

    def count_dropped(self, error: Exception) -> None:
        """Count a map that could not be filtered."""
        self.maps_dropped += 1
        self.last_was_dropped = True
        self.last_error = str(error)

    def count_out(self) -> None:
        """Count a map that was filtered."""
        self.maps_out += 1
        self.last_was_dropped = False

    def to_status(self, name: str) -> DiagnosticStatus:
        """Return the statistics as a diagnostic message."""
        values = {
            "maps in": str(self.maps_in),
            "maps out": str(self.maps_out),
            "maps dropped": str(self.maps_dropped),
            "last error": self.last_error,
            **self._milliseconds(),
        }
        return DiagnosticStatus(
            level=DiagnosticStatus.WARN if self.last_was_dropped else DiagnosticStatus.OK,
            name=f"{name}: filter chain",
            message=f"{self.maps_dropped} of {self.maps_in} maps dropped",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )

    def _milliseconds(self) -> dict[str, str]:
        values = {"ms": self.times.last, "mean ms": self.times.mean}
        for time in self.times:
            name = time.config.name
            values |= {
                f"ms {name}": time.last,
                f"mean ms {name}": time.mean,
                f"max ms {name}": time.longest,
            }
        return {key: f"{value:.3f}" for key, value in values.items()}


class FilterChainNode(Node):
    """Subscribes to maps, filters them and publishes the results."""

    def __init__(self) -> None:
        # A filter that is added while the node runs brings parameters that are not declared.
        super().__init__(NODE_NAME, allow_undeclared_parameters=True)
        topic = _read_topic(self, "input_topic", "/grid_map", "topic of the incoming maps")
        output = _read_topic(self, "output_topic", "/filtered_map", "filtered maps go there")
        self._chain = FilterChain.from_config(self._read_chain())
        self._next_chain: FilterChain | None = None
        self._statistics = Statistics()
        self._throttle = LogThrottle()
        self._publisher = self.create_publisher(GridMapMessage, output, map_qos())
        if self.resolve_topic_name(topic) == self._publisher.topic_name:
            raise ConfigError(f"input_topic and output_topic are both {topic!r}")
        about = "time between two reports on `/diagnostics` [s]"
        period = read_positive(self, "diagnostics_period", 1.0, description=about)
        self._report_diagnostics(period)
        self.add_on_set_parameters_callback(self._prepare_chain)
        self.add_post_set_parameters_callback(self._replace_chain)
        self._subscription = MapSubscription(self, topic, self._on_map)
        self.get_logger().info(f"{self._chain} on {topic}")

    # --- parameters -------------------------------------------------------------------------------

    def _read_chain(self) -> dict[str, Any]:
        name = "filter_chain_parameter_name"
        about = "name of the parameter with the chain"
        self._chain_name = read_parameter(self, name, str, "filters", description=about)
        about = "the chain: of `filter1`, `filter2`, ... each a `name`, a `type` and its `params`"
        return read_parameter_tree(self, self._chain_name, read_only=False, description=about)

    def _is_of_chain(self, name: str) -> bool:
        return name.startswith(f"{self._chain_name}.")

    def _prepare_chain(self, changes: list[Parameter]) -> SetParametersResult:
        """Build the chain that the changes ask for; refuse them if there is none."""
        self._next_chain = None
        try:
            self._check_known(changes)
            of_chain = [change for change in changes if self._is_of_chain(change.name)]
            if of_chain:
                self._next_chain = FilterChain.from_config(self._changed_config(of_chain))
        except GridMapError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _replace_chain(self, _changes: list[Parameter]) -> None:
        """Use the new chain after all callbacks have accepted the change."""
        if self._next_chain is not None:
            self._chain, self._next_chain = self._next_chain, None
            self._statistics.times = StepTimes()
            self.get_logger().info(f"now {self._chain}")

    def _check_known(self, changes: list[Parameter]) -> None:
        for change in changes:
            if not (self._is_of_chain(change.name) or self.has_parameter(change.name)):
                raise ConfigError(
                    f"unknown parameter {change.name!r}; those that can be set begin with "
                    f"'{self._chain_name}.'"
                )

    def _changed_config(self, changes: list[Parameter]) -> dict[str, Any]:
        """Return the configuration of the chain with the changes; one without type deletes."""
        parameters: dict[str, Any] = dict(self.get_parameters_by_prefix(self._chain_name))
        for change in changes:
            name = change.name.removeprefix(f"{self._chain_name}.")
            parameters[name] = change
            if change.type_ == Parameter.Type.NOT_SET:
                del parameters[name]
        return nested({name: _plain(parameter.value) for name, parameter in parameters.items()})

    # --- maps -------------------------------------------------------------------------------------

    def _on_map(self, received: ReceivedMap) -> None:
        self._statistics.maps_in += 1
        try:
            reply = self._filter(received)
        except GridMapError as error:
            self._statistics.count_dropped(error)
            text = f"dropped a map: {error}"
            if self._throttle.allow(text):
                self.get_logger().error(text)
        else:
            self._publisher.publish(reply)
            self._statistics.count_out()

    def _filter(self, received: ReceivedMap) -> bytes:
        grid_map = received.decode(unwrap=False, copy=False)
        warnings: list[str] = []
        try:
            result, start_index = self._chain.without_copies(
                grid_map, self._statistics.times, warnings=warnings
            )
        finally:
            for text in warnings:
                if self._throttle.allow(text):
                    self.get_logger().warning(text)
        return to_serialized_message(result, start_index=start_index)

    # --- diagnostics ------------------------------------------------------------------------------

    def _report_diagnostics(self, period: float) -> None:
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        # Reports go on while a simulation is paused.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(period, self._publish_diagnostics, clock=steady)

    def _publish_diagnostics(self) -> None:
        if self._diagnostics.get_subscription_count() == 0:
            return
        message = DiagnosticArray(status=[self._statistics.to_status(self.get_name())])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def _read_topic(node: Node, name: str, default: str, description: str) -> str:
    topic = read_parameter(node, name, str, default, description=description)
    return check_topic(node, name, topic)


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, array.array) else value


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(FilterChainNode)


if __name__ == "__main__":
    sys.exit(main())
