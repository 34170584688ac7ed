# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Subscriptions that receive from latched and from volatile publishers."""

from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy

from grid_map_msgs.msg import GridMap as GridMapMessage

from ..messages._grid_map import ReceivedMap
from ._qos import map_qos


class LatchedSubscription:
    """Calls back with the last message of a topic and all later messages.

    A transient local subscription gets the message that was published before it, but does not
    connect to volatile publishers. The subscription is transient local first, and becomes volatile
    when it meets a volatile publisher.

    Args:
        node: the node that subscribes.
        message_type: class of the messages.
        topic: name of the topic.
        callback: called with every message.
        qos: fixed quality of service; None means the above.
        raw: whether the callback gets the bytes of the message.
        hears_best_effort: whether to become best effort on meeting a best-effort publisher, as
            sensors have; otherwise such a publisher is only named in the log.
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
        hears_best_effort: bool = False,
    ) -> None:
        self._node = node
        self._message_type = message_type
        self._topic = topic
        self._callback = callback
        self._raw = raw
        self._qos = qos or map_qos()
        self._can_give_up = set[QoSPolicyKind]()
        if qos is None:
            self._can_give_up.add(QoSPolicyKind.DURABILITY)
        if qos is None and hears_best_effort:
            self._can_give_up.add(QoSPolicyKind.RELIABILITY)
        self._given_up = set[QoSPolicyKind]()
        self._subscription: Any = None
        self._subscribe()

    def destroy(self) -> None:
        """Destroy the subscription."""
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _subscribe(self) -> None:
        self._subscription = self._node.create_subscription(
            self._message_type,
            self._topic,
            self._callback,
            self._qos,
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._on_incompatible),
            raw=self._raw,
        )

    def _on_incompatible(self, event: Any) -> None:
        kind = QoSPolicyKind(event.last_policy_kind)
        executor = self._node.executor
        if kind not in self._can_give_up:
            self._node.get_logger().warning(
                f"no messages from a publisher of {self._topic}: incompatible quality of service "
                f"({kind.name.lower()})"
            )
        elif kind not in self._given_up and executor is not None:
            self._given_up.add(kind)
            # Deferred, because this is a callback of the subscription that will be destroyed.
            executor.create_task(self._subscribe_without, kind)

    def _subscribe_without(self, kind: QoSPolicyKind) -> None:
        if self._subscription is None:
            return
        if kind == QoSPolicyKind.DURABILITY:
            self._qos.durability = DurabilityPolicy.VOLATILE
            text = "is volatile: from now on, earlier messages are not requested"
        else:
            self._qos.reliability = ReliabilityPolicy.BEST_EFFORT
            text = "is best effort: from now on, lost messages are not requested again"
        self._node.get_logger().info(f"a publisher of {self._topic} {text}")
        self.destroy()
        self._subscribe()


class MapSubscription(LatchedSubscription):
    """Calls back with the last map of a topic and all later maps, as received.

    It receives from latched, reliable and volatile publishers. Nothing is decoded in advance: the
    callback decodes the layers that it needs. Keep a reference to the subscription.

    Args:
        node: the node that subscribes.
        topic: topic of `grid_map_msgs/GridMap`.
        callback: called with every map.
        qos: fixed quality of service; None means as for `LatchedSubscription`.

    Example:
        >>> def on_map(received):
        ...     print(received.decode(["elevation"]))
        >>> subscription = MapSubscription(node, "/grid_map", on_map)  # doctest: +SKIP
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
