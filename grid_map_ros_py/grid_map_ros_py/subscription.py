# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A subscription to maps that decodes nothing, and gets along with every reliable publisher."""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSPolicyKind, QoSProfile

from grid_map_msgs.msg import GridMap as GridMapMessage

from .qos import map_qos
from .serialized import ReceivedMap


class LatchedSubscription:
    """Calls back with the last message of a topic and all that follow.

    A transient local subscription gets the message that was published before it, but does not
    connect to volatile publishers. So it asks for that message first, and does without once it
    meets such a publisher.

    Args:
        node: the node that subscribes.
        message_type: of the topic.
        topic: its name.
        callback: gets every message.
        qos: quality of service, for subscriptions that do not change; None means the above.
        raw: whether the callback gets the bytes of the message.
    """

    def __init__(
        self,
        node: Node,
        message_type: type,
        topic: str,
        callback: Callable[[Any], None],
        *,
        qos: QoSProfile | None = None,
        raw: bool = False,
    ) -> None:
        self._node = node
        self._message_type = message_type
        self._topic = topic
        self._callback = callback
        self._raw = raw
        self._adapts = qos is None
        self._has_adapted = False
        self._subscription: Any = None
        self._subscribe(qos or map_qos())

    def destroy(self) -> None:
        """Give the subscription up."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _subscribe(self, qos: QoSProfile) -> None:
        self._subscription = self._node.create_subscription(
            self._message_type,
            self._topic,
            self._callback,
            qos,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._on_incompatible),
            raw=self._raw,
        )

    def _on_incompatible(self, event: Any) -> None:
        is_volatile = event.last_policy_kind == QoSPolicyKind.DURABILITY
        executor = self._node.executor
        if not (is_volatile and self._adapts):
            self._node.get_logger().warning(
                f"a publisher of {self._topic} is not heard: its quality of service does not fit "
                f"in {QoSPolicyKind(event.last_policy_kind).name.lower()}"
            )
        elif not self._has_adapted and executor is not None:
            self._has_adapted = True
            # Not from within an event of the very subscription that goes.
            executor.create_task(self._subscribe_again)

    def _subscribe_again(self) -> None:
        if self._subscription is not None:
            self._node.get_logger().info(
                f"a publisher of {self._topic} is volatile: its past is not asked for any more"
            )
            self.destroy()
            self._subscribe(map_qos(transient_local=False))


class MapSubscription(LatchedSubscription):
    """Calls back with the last map of a topic and all that follow, as they were received.

    The callback decodes what it needs, if it needs the map at all: nothing is converted before.

    Args:
        node: the node that subscribes.
        topic: of `grid_map_msgs/GridMap`.
        callback: gets every map.
        qos: quality of service, for subscriptions that do not change; None means what is said at
            `LatchedSubscription`.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        callback: Callable[[ReceivedMap], None],
        *,
        qos: QoSProfile | None = None,
    ) -> None:
        super().__init__(
            node,
            GridMapMessage,
            topic,
            lambda data: callback(ReceivedMap(data)),
            qos=qos,
            raw=True,
        )
