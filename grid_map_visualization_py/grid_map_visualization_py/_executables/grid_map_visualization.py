# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_visualization`: publishes a map in the forms that its subscribers ask for."""

import sys
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile

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
    run,
)

from .._registry import create
from .._visualization import Visualization


class GridMapVisualizationNode(Node):
    """Subscribes to a map while somebody listens, and converts it for those outputs only.

    The last map is kept as long as the subscription lasts, so that an output has something to show
    to a listener who comes late.
    """

    def __init__(self) -> None:
        super().__init__("grid_map_visualization")
        self._topic = _read_topic(self)
        self._qos = _read_qos(self)
        self._throttle = LogThrottle()
        self._subscription: MapSubscription | None = None
        self._map: GridMap | None = None
        about = "how often to look for listeners [Hz], where the middleware does not tell"
        rate = read_positive(self, "activity_check_rate", 2.0, description=about)
        self._outputs = [
            Output(self, name, visualization, self._follow_listeners)
            for name, visualization in _read_visualizations(self).items()
        ]
        # Listeners are noticed when they come and go; this is for those whose event went missing.
        self.create_timer(1 / rate, self._follow_listeners, clock=_steady_clock())
        names = ", ".join(output.name for output in self._outputs) or "nothing"
        self.get_logger().info(f"shows {self._topic} as {names}, while somebody listens")

    def _follow_listeners(self) -> None:
        if sum(output.count_listeners() for output in self._outputs):
            self._subscribe()
        else:
            self._unsubscribe()
        self._publish_due()

    def _subscribe(self) -> None:
        if self._subscription is None:
            self._subscription = MapSubscription(self, self._topic, self._receive, qos=self._qos)

    def _unsubscribe(self) -> None:
        if self._subscription is not None:
            self._subscription.destroy()
            self._subscription = None
            self._map = None

    def _receive(self, received: ReceivedMap) -> None:
        try:
            self._map = received.decode(unwrap=False)
        except GridMapError as error:
            text = f"cannot use the map on {self._topic!r}: {error}"
            if self._throttle.allow(text):
                self.get_logger().error(text)
            return
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
        name: name of the topic and of the visualization.
        visualization: makes the messages.
        on_match: called when a listener came or went.

    Attributes:
        name: as above.
        is_due: listeners have not got the last map yet.
    """

    def __init__(
        self, node: Node, name: str, visualization: Visualization, on_match: Callable[[], None]
    ) -> None:
        self.name = name
        self.is_due = False
        self._listeners = 0
        self._visualization = visualization
        self._on_match = on_match
        self._throttle = LogThrottle()
        self._logger = node.get_logger()
        events = PublisherEventCallbacks(matched=self._match)
        self._publisher = node.create_publisher(
            visualization.message_type, name, map_qos(), event_callbacks=events
        )

    def count_listeners(self) -> int:
        """Return how many listen now; more than before makes the output due."""
        before, self._listeners = self._listeners, self._publisher.get_subscription_count()
        self.is_due |= self._listeners > before
        return self._listeners

    def publish_if_due(self, grid_map: GridMap) -> None:
        """Publish what the visualization makes of a map, if listeners wait for it."""
        if not (self.is_due and self._listeners):
            return
        self.is_due = False
        try:
            message = self._visualization(grid_map)
        except Exception as error:  # Plugins may raise anything, and the other outputs go on.
            text = f"visualization {self.name!r}: {_text(error)}"
            if self._throttle.allow(text):
                self._logger.warning(text)
        else:
            self._publisher.publish(message)

    def _match(self, status: Any) -> None:
        # One who comes while another goes leaves the count as it was. The publisher's durability is
        # not enough for those who come: by default RViz asks for a volatile topic.
        self.is_due |= status.total_count_change > 0
        self._on_match()


def _read_topic(node: Node) -> str:
    name = "grid_map_topic"
    about = "maps come from here"
    return check_topic(node, name, read_parameter(node, name, str, "/grid_map", description=about))


def _read_qos(node: Node) -> QoSProfile:
    about = (
        "ask for the last map that was published before somebody listened; maps of a volatile "
        "publisher arrive with `false` only"
    )
    transient_local = read_parameter(node, "transient_local", bool, False, description=about)
    return map_qos(transient_local=transient_local)


def _read_visualizations(node: Node) -> Mapping[str, Visualization]:
    parameter = "grid_map_visualizations"
    about = "names of the visualizations; each is published on the topic of its name"
    names = read_parameter(node, parameter, list[str], description=about)
    check(len(set(names)) == len(names), parameter, "every name once", names)
    about = "log a visualization that is misconfigured and show the others, instead of ending"
    skip_invalid = read_parameter(node, "skip_invalid", bool, False, description=about)
    about = "of the visualization of that name: `type`, and `params` by their names"
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


def _steady_clock() -> Clock:
    # The node's own clock stands still while a simulation is paused.
    return Clock(clock_type=ClockType.STEADY_TIME)


def _text(error: Exception) -> str:
    return str(error) if isinstance(error, GridMapError) else repr(error)


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(GridMapVisualizationNode)


if __name__ == "__main__":
    sys.exit(main())
