# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_filters`: runs a filter chain on every map of a topic.

The parameters of the chain can be set while the node runs. The node builds the new chain first; if
that fails, it refuses the change with the reason and keeps the old chain.

While there are subscribers, the node also publishes `diagnostic_msgs/DiagnosticArray` on
`/diagnostics`: numbers of maps in, out and dropped, the last error, and the last, mean and maximum
duration of each filter [ms].
"""

import array
import sys
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_core_py.plugins import nested
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import ReceivedMap, to_serialized_message
from grid_map_ros_py.nodes import (
    LogThrottle,
    MapSubscription,
    map_qos,
    read_parameter,
    read_parameter_tree,
    read_positive,
    read_topic,
    run,
    steady_timer,
)

from .._chain import FilterChain, StepTimes, describe_parameters


@dataclass
class Statistics:
    """Numbers of maps, the last error and the durations of the steps of a node."""

    maps_in: int = 0
    maps_out: int = 0
    maps_dropped: int = 0
    last_was_dropped: bool = False
    last_error: str = ""
    times: StepTimes = field(default_factory=StepTimes)

    def to_status(self, name: str) -> DiagnosticStatus:
        """Return the statistics as a diagnostic message."""
        milliseconds = {"ms": self.times.last, "mean ms": self.times.mean}
        for time in self.times:
            milliseconds[f"ms {time.config.name}"] = time.last
            milliseconds[f"mean ms {time.config.name}"] = time.mean
            milliseconds[f"max ms {time.config.name}"] = time.longest
        values = {
            "maps in": str(self.maps_in),
            "maps out": str(self.maps_out),
            "maps dropped": str(self.maps_dropped),
            "last error": self.last_error,
            **{key: f"{value:.3f}" for key, value in milliseconds.items()},
        }
        return DiagnosticStatus(
            level=DiagnosticStatus.WARN if self.last_was_dropped else DiagnosticStatus.OK,
            name=f"{name}: filter chain",
            message=f"{self.maps_dropped} of {self.maps_in} maps dropped",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )


class FilterChainNode(Node):
    """Subscribes to maps, filters them and publishes the results."""

    def __init__(self) -> None:
        # A filter added at run time has parameters that are not declared.
        super().__init__("grid_map_filters", allow_undeclared_parameters=True)
        about = "topic of the incoming maps"
        topic = read_topic(self, "input_topic", "/grid_map", description=about)
        about = "topic of the filtered maps"
        output = read_topic(self, "output_topic", "/filtered_map", description=about)
        name, about = "filter_chain_parameter_name", "name of the parameter with the chain"
        self._chain_name = read_parameter(self, name, str, "filters", description=about)
        about = "the chain: of `filter1`, `filter2`, ... each a `name`, a `type` and its `params`"
        tree = read_parameter_tree(
            self,
            self._chain_name,
            read_only=False,
            description=about,
            describe=describe_parameters,
        )
        self._chain = FilterChain.from_config(tree)
        self._next_chain: FilterChain | None = None
        self._statistics = Statistics()
        self._log = LogThrottle(self.get_logger())
        self._publisher = self.create_publisher(GridMapMessage, output, map_qos())
        if self.resolve_topic_name(topic) == self._publisher.topic_name:
            raise ConfigError(f"input_topic and output_topic are both {topic!r}")
        about = "time between two reports on `/diagnostics` [s]"
        period = read_positive(self, "diagnostics_period", 1.0, description=about)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady_timer(self, period, self._publish_diagnostics)
        self.add_on_set_parameters_callback(self._prepare_chain)
        self.add_post_set_parameters_callback(self._replace_chain)
        self._subscription = MapSubscription(self, topic, self._on_map)
        self.get_logger().info(f"{self._chain} on {self._subscription.topic_name}")

    # --- parameters -------------------------------------------------------------------------------

    def _is_of_chain(self, name: str) -> bool:
        return name.startswith(f"{self._chain_name}.")

    def _prepare_chain(self, changes: list[Parameter]) -> SetParametersResult:
        """Build the chain with the changed parameters, or reject the change."""
        self._next_chain = None
        try:
            for change in changes:
                is_there = self.has_parameter(change.name)
                if change.type_ == Parameter.Type.NOT_SET and not is_there:
                    raise ConfigError(f"no parameter {change.name!r} to delete")
                if not (self._is_of_chain(change.name) or is_there):
                    raise ConfigError(
                        f"unknown parameter {change.name!r}; those that can be set begin with "
                        f"'{self._chain_name}.'"
                    )
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

    def _changed_config(self, changes: list[Parameter]) -> dict[str, Any]:
        """Return the configuration with the changes; those without a type delete parameters."""
        parameters: dict[str, Any] = dict(self.get_parameters_by_prefix(self._chain_name))
        for change in changes:
            name = change.name.removeprefix(f"{self._chain_name}.")
            parameters[name] = change
            if change.type_ == Parameter.Type.NOT_SET:
                del parameters[name]
        values = ((name, parameter.value) for name, parameter in parameters.items())
        return nested({name: list(v) if isinstance(v, array.array) else v for name, v in values})

    # --- maps -------------------------------------------------------------------------------------

    def _on_map(self, received: ReceivedMap) -> None:
        statistics, warnings = self._statistics, list[str]()
        statistics.maps_in += 1
        try:
            grid_map = received.decode(unwrap=False, copy=False)
            result, start = self._chain.without_copies(
                grid_map, statistics.times, warnings=warnings
            )
            self._publisher.publish(to_serialized_message(result, start_index=start))
        except GridMapError as error:
            statistics.maps_dropped += 1
            statistics.last_was_dropped, statistics.last_error = True, str(error)
            raise
        else:
            statistics.maps_out += 1
            statistics.last_was_dropped = False
        finally:
            for text in warnings:
                self._log.warning(text)

    # --- diagnostics ------------------------------------------------------------------------------

    def _publish_diagnostics(self) -> None:
        if self._diagnostics.get_subscription_count() == 0:
            return
        message = DiagnosticArray(status=[self._statistics.to_status(self.get_name())])
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(FilterChainNode)


if __name__ == "__main__":
    sys.exit(main())
