# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A subscription to maps that gets along with every reliable publisher."""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind

from grid_map_msgs.msg import GridMap as GridMapMessage

from .qos import map_qos


class MapSubscription:
    """Calls back with the last map of a topic and all that follow.

    A transient local subscription gets the map that was published before it, but does not connect
    to volatile publishers. So it asks for that map first, and does without once it meets such a
    publisher.

    Args:
        node: the node that subscribes.
        topic: of `grid_map_msgs/GridMap`.
        callback: gets every message.
    """

    def __init__(self, node: Node, topic: str, callback: Callable[[GridMapMessage], None]) -> None:
        self._node = node
        self._topic = topic
        self._callback = callback
        self._transient_local = True
        self._subscription = self._subscribe()

    def _subscribe(self) -> Any:
        return self._node.create_subscription(
            GridMapMessage,
            self._topic,
            self._callback,
            map_qos(transient_local=self._transient_local),
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._on_incompatible),
        )

    def _on_incompatible(self, event: Any) -> None:
        is_volatile = event.last_policy_kind == QoSPolicyKind.DURABILITY
        executor = self._node.executor
        if is_volatile and self._transient_local and executor is not None:
            self._transient_local = False
            # Not from within an event of the very subscription that goes.
            executor.create_task(self._subscribe_again)
        elif not is_volatile:
            self._node.get_logger().warning(
                f"a publisher of {self._topic} is not heard: its quality of service does not fit "
                f"in {QoSPolicyKind(event.last_policy_kind).name.lower()}"
            )

    def _subscribe_again(self) -> None:
        self._node.get_logger().info(
            f"a publisher of {self._topic} is volatile: maps of the past are not asked for any more"
        )
        self._node.destroy_subscription(self._subscription)
        self._subscription = self._subscribe()
