# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_visualization`: converts maps to messages that RViz and Foxglove show."""

from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.plugins import check
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.nodes import (
    ConfiguredNode,
    MapSubscription,
    map_qos,
    read_parameter,
    read_parameter_tree,
)
from grid_map_ros_py.nodes._health import LogThrottle, health_of
from grid_map_ros_py.nodes._parameters import check_topic
from grid_map_ros_py.nodes._spin import steady_timer

from .._registry import Visualization, create, describe_parameters


class GridMapVisualizationNode(ConfiguredNode):
    """Node that converts maps to visualizations and publishes those with subscribers."""

    def __init__(self) -> None:
        super().__init__("grid_map_visualization")
        self._topic = self.read_topic("grid_map_topic", "/grid_map", "topic of grid maps")
        about = (
            "receive the last map even if it was published before the node subscribed; set to "
            "false for volatile publishers"
        )
        latched = self.read("transient_local", False, about)
        self._qos = map_qos(transient_local=latched)
        self._subscription: MapSubscription | None = None
        self._map: GridMap | None = None
        about = "rate of additional checks for subscribers [Hz], in case a DDS event is lost"
        rate = self.read_positive("activity_check_rate", 2.0, about)
        self._log = LogThrottle(self.get_logger())
        self._outputs = self._read_outputs()
        for output in self._outputs:
            events = PublisherEventCallbacks(matched=partial(self._match, output))
            output.publisher = self.create_publisher(
                output.visualization.message_type, output.name, map_qos(), event_callbacks=events
            )
        # Events report when subscribers join and leave; the timer is a fallback for lost events.
        steady_timer(self, 1 / rate, self._follow_subscribers)
        topic = self.resolve_topic_name(self._topic)
        names = ", ".join(output.publisher.topic_name for output in self._outputs) or "nothing"
        self.get_logger().info(f"shows {topic} as {names}, while there are subscribers")

    def _read_outputs(self) -> list["Output"]:
        parameter = "grid_map_visualizations"
        about = "names of the visualizations; each publishes on a topic of the same name"
        names = read_parameter(self, parameter, list[str], description=about)
        check(len(set(names)) == len(names), parameter, "every name once", names)
        about = "if true, log misconfigured visualizations and skip them; if false, the node exits"
        skip_invalid = self.read("skip_invalid", False, about)
        about = "`type` and `params` of the visualization `NAME`"
        outputs = []
        for name in names:
            try:
                config = read_parameter_tree(
                    self, name, description=about, describe=describe_parameters
                )
                check_topic(self, parameter, name)
                outputs.append(Output(name, create(name, config)))
            except GridMapError as error:
                if not skip_invalid:
                    raise
                self.get_logger().error(f"skipped: {error}")
        return outputs

    def _match(self, output: "Output", status: Any) -> None:
        # A new subscriber needs the last map even if another one has just left and the number of
        # subscribers is therefore unchanged. Latching alone is not enough, because subscribers with
        # volatile durability, the default of RViz, do not receive latched messages.
        output.is_due |= status.total_count_change > 0
        self._follow_subscribers()

    def _follow_subscribers(self) -> None:
        for output in self._outputs:
            before = output.subscribers
            output.subscribers = output.publisher.get_subscription_count()
            output.is_due |= output.subscribers > before
        is_needed = any(output.subscribers for output in self._outputs)
        if is_needed and self._subscription is None:
            self._subscription = MapSubscription(self, self._topic, self._receive, qos=self._qos)
        elif not is_needed and self._subscription is not None:
            self._subscription.destroy()
            self._subscription = self._map = None
        self._publish_due()

    def _receive(self, received: ReceivedMap) -> None:
        self._map = received.decode(unwrap=False)
        for output in self._outputs:
            output.is_due = True
        self._publish_due()

    def _publish_due(self) -> None:
        for output in self._outputs:
            if not output.subscribers:
                output.problem = ""
            if self._map is None or not (output.is_due and output.subscribers):
                continue
            output.is_due, output.problem = False, ""
            try:
                output.publisher.publish(output.visualization(self._map))
            except Exception as error:  # A plugin error must not affect other outputs.
                cause = str(error) if isinstance(error, GridMapError) else repr(error)
                output.problem = f"visualization {output.name!r}: {cause}"
                self._log.warning(output.problem)
        problems = (output.problem for output in self._outputs)
        health_of(self).problem = "; ".join(filter(None, problems))


@dataclass
class Output:
    """A visualization and its publisher; `name` is also the topic."""

    name: str
    visualization: Visualization
    publisher: Any = None
    subscribers: int = 0
    is_due: bool = False  # True if some subscribers have not received the last map yet
    problem: str = ""  # error if the last map could not be published


if __name__ == "__main__":
    raise SystemExit(GridMapVisualizationNode.main())
