# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_visualization`: converts maps to messages that RViz and Foxglove show."""

from collections.abc import Callable, Mapping
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.plugins import check
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.nodes import (
    LogThrottle,
    MapSubscription,
    check_topic,
    map_qos,
    read_parameter,
    read_parameter_tree,
    read_positive,
    read_topic,
    run,
    steady_timer,
)

from .._registry import Visualization, create


class GridMapVisualizationNode(Node):
    """Subscribes to maps while an output has a subscriber, and converts for these outputs only.

    The last map is kept while the node is subscribed, so that a late subscriber of an output gets
    it at once.
    """

    def __init__(self) -> None:
        super().__init__("grid_map_visualization")
        about = "topic of the maps"
        self._topic = read_topic(self, "grid_map_topic", "/grid_map", description=about)
        about = (
            "also get the last map that was published before the node subscribed; maps of a "
            "volatile publisher arrive only if false"
        )
        latched = read_parameter(self, "transient_local", bool, False, description=about)
        self._qos = map_qos(transient_local=latched)
        self._subscription: MapSubscription | None = None
        self._map: GridMap | None = None
        about = "rate at which the node counts subscribers [Hz], for middleware without events"
        rate = read_positive(self, "activity_check_rate", 2.0, description=about)
        self._outputs = [
            Output(self, name, visualization, self._follow_subscribers)
            for name, visualization in _read_visualizations(self).items()
        ]
        # Events tell when subscribers come and go; the timer is for lost events.
        steady_timer(self, 1 / rate, self._follow_subscribers)
        names = ", ".join(output.name for output in self._outputs) or "nothing"
        self.get_logger().info(f"shows {self._topic} as {names}, while there are subscribers")

    def _follow_subscribers(self) -> None:
        is_needed = sum(output.count_subscribers() for output in self._outputs) > 0
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
        if self._map is not None:
            for output in self._outputs:
                output.publish_if_due(self._map)


class Output:
    """A visualization and its publisher.

    Args:
        node: the node that publishes.
        name: name of the visualization, which is also its topic.
        visualization: makes the messages.
        on_match: called when a subscriber came or went.

    Attributes:
        name: as above.
        is_due: the last map has not been published for all subscribers yet.
    """

    def __init__(
        self, node: Node, name: str, visualization: Visualization, on_match: Callable[[], None]
    ) -> None:
        self.name = name
        self.is_due = False
        self._subscribers = 0
        self._visualization = visualization
        self._on_match = on_match
        self._log = LogThrottle(node.get_logger())
        events = PublisherEventCallbacks(matched=self._match)
        self._publisher = node.create_publisher(
            visualization.message_type, name, map_qos(), event_callbacks=events
        )

    def count_subscribers(self) -> int:
        """Return the number of subscribers; if it has grown, the output becomes due."""
        before, self._subscribers = self._subscribers, self._publisher.get_subscription_count()
        self.is_due |= self._subscribers > before
        return self._subscribers

    def publish_if_due(self, grid_map: GridMap) -> None:
        """Publish the message of a map if subscribers wait for it."""
        if not (self.is_due and self._subscribers):
            return
        self.is_due = False
        try:
            message = self._visualization(grid_map)
        except Exception as error:  # Plugins may raise anything, and the other outputs go on.
            cause = str(error) if isinstance(error, GridMapError) else repr(error)
            self._log.warning(f"visualization {self.name!r}: {cause}")
        else:
            self._publisher.publish(message)

    def _match(self, status: Any) -> None:
        # A simultaneous join and leave keeps the count unchanged. A latched publisher is not enough
        # for a late subscriber, because RViz by default asks for a volatile topic.
        self.is_due |= status.total_count_change > 0
        self._on_match()


def _read_visualizations(node: Node) -> Mapping[str, Visualization]:
    parameter = "grid_map_visualizations"
    about = "names of the visualizations, which are also their topics"
    names = read_parameter(node, parameter, list[str], description=about)
    check(len(set(names)) == len(names), parameter, "every name once", names)
    about = "log a misconfigured visualization and continue with the others instead of ending"
    skip_invalid = read_parameter(node, "skip_invalid", bool, False, description=about)
    about = "`type` and `params` of the visualization of that name"
    visualizations = {}
    for name in names:
        try:
            check_topic(node, parameter, name)
            config = read_parameter_tree(node, name, description=about)
            visualizations[name] = create(name, config)
        except GridMapError as error:
            if not skip_invalid:
                raise
            node.get_logger().error(f"skipped: {error}")
    return visualizations


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(GridMapVisualizationNode)


if __name__ == "__main__":
    raise SystemExit(main())
