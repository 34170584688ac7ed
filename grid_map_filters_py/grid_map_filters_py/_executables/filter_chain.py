# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_filters`: filters every map that arrives on a topic, and publishes the result.

The parameters of the chain can be changed while the node runs. If the new chain cannot be built,
the node rejects the change, reports the reason and keeps the old chain.

Diagnostics on `/diagnostics` include the last, mean and maximum duration of each filter [ms].
"""

import array
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from grid_map_core_py._parameters import nested
from grid_map_core_py.errors import ConfigError, GridMapError, cut
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import ReceivedMap, to_serialized_message
from grid_map_ros_py.nodes import ConfiguredNode, MapSubscription, map_qos, read_parameter_tree
from grid_map_ros_py.nodes._health import LogThrottle, health_of

from .._chain import FilterChain, describe_parameters
from .._times import StepTimes


class FilterChainNode(ConfiguredNode):
    def __init__(self) -> None:
        # Allow parameters of filters that are added while the node runs.
        super().__init__("grid_map_filters", allow_undeclared_parameters=True)
        topic = self.read_topic("input_topic", "/grid_map", "topic of the incoming maps")
        output = self.read_topic("output_topic", "/filtered_map", "topic of the filtered maps")
        about = "name of the parameter that holds the chain"
        self._chain_name = self.read("filter_chain_parameter_name", "filters", about)
        about = "filters `filter1`, `filter2`, ..., each with `name`, `type` and `params`"
        tree = read_parameter_tree(
            self, self._chain_name, read_only=False, description=about, describe=describe_parameters
        )
        self._threads = self.read("threads", 1, "number of threads that the filters may use")
        self._chain = FilterChain.from_config(tree, threads=self._threads)
        self._next_chain: FilterChain | None = None
        self._times = StepTimes()
        health_of(self).details = self._milliseconds
        self._log = LogThrottle(self.get_logger())
        self._publisher = self.create_publisher(GridMapMessage, output, map_qos())
        if self.resolve_topic_name(topic) == self._publisher.topic_name:
            raise ConfigError(f"input_topic and output_topic are both {topic!r}")
        self.add_on_set_parameters_callback(self._prepare_chain)
        self.add_post_set_parameters_callback(self._replace_chain)
        self._subscription = MapSubscription(self, topic, self._on_map)
        self.get_logger().info(f"{self._chain} on {self._subscription.topic_name}")

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
            of_chain = {
                change.name.removeprefix(f"{self._chain_name}."): change
                for change in changes
                if self._is_of_chain(change.name)
            }
            if of_chain:
                before: dict[str, Any] = dict(self.get_parameters_by_prefix(self._chain_name))
                values = {
                    name: list(parameter.value)
                    if isinstance(parameter.value, array.array)
                    else parameter.value
                    for name, parameter in (before | of_chain).items()
                    if parameter.type_ != Parameter.Type.NOT_SET  # deleted parameter
                }
                self._next_chain = FilterChain.from_config(nested(values), threads=self._threads)
        except GridMapError as error:
            return SetParametersResult(successful=False, reason=str(error))
        except Exception as error:  # Requests and plug-ins may cause any exception.
            self._log.error(f"set_parameters: {error!r}")
            return SetParametersResult(successful=False, reason=cut(repr(error)))
        return SetParametersResult(successful=True)

    def _replace_chain(self, _changes: list[Parameter]) -> None:
        """Activate the new chain once all callbacks have accepted the change."""
        if self._next_chain is not None:
            self._chain, self._next_chain = self._next_chain, None
            self._times = StepTimes()
            self._log.info(f"now {self._chain}")

    def _on_map(self, received: ReceivedMap) -> None:
        warnings = list[str]()
        grid_map = received.decode(unwrap=False, copy=False)
        try:
            result, start = self._chain.without_copies(grid_map, self._times, warnings=warnings)
        finally:
            for text in warnings:
                self._log.warning(text)
        self._publisher.publish(to_serialized_message(result, start_index=start))

    def _milliseconds(self) -> dict[str, str]:
        found = {"ms": self._times.last, "mean ms": self._times.mean}
        for time in self._times:
            found[f"ms {time.config.name}"] = time.last
            found[f"mean ms {time.config.name}"] = time.mean
            found[f"max ms {time.config.name}"] = time.longest
        return {key: f"{value:.3f}" for key, value in found.items()}


if __name__ == "__main__":
    raise SystemExit(FilterChainNode.main())
