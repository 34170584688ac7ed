# SPDX-License-Identifier: BSD-3-Clause
"""Publishers, subscriptions and services for nodes, and the quality of service of map topics."""

import math
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy

from grid_map_core_py._arrays import LARGEST_BLOCK, keep_memory
from grid_map_core_py.errors import hint
from grid_map_msgs.msg import GridMap as GridMapMessage

from ..messages._grid_map import ReceivedMap
from ._health import LogThrottle, dropping, health_of

WEAKER: dict[QoSPolicyKind, Any] = {
    QoSPolicyKind.DURABILITY: DurabilityPolicy.VOLATILE,
    QoSPolicyKind.RELIABILITY: ReliabilityPolicy.BEST_EFFORT,
}
"""QoS policies that a subscription can relax, and the weaker value of each policy."""


def map_qos(*, transient_local: bool = True) -> QoSProfile:
    """Return the quality of service (QoS) of map topics: reliable, depth 1, latched by default.

    Args:
        transient_local: if True (latched), publishers keep the last map for subscribers that join
            late, and subscribers request this map. Map publishers always use True. If False, a
            subscriber also receives maps from volatile publishers, but no earlier maps.
    """
    durability = DurabilityPolicy.TRANSIENT_LOCAL if transient_local else DurabilityPolicy.VOLATILE
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=durability)


def warn_of_gaps(node: Node, topic: str) -> Callable[[Any], None]:
    """Return an event callback that logs a warning the first time a message is lost."""
    log = LogThrottle(node.get_logger(), period=math.inf)
    text = (
        f"messages of {node.resolve_topic_name(topic)} get lost: they come faster than this node "
        "takes them, or the middleware of their publisher has too little memory for messages of "
        "this size; see 'Large maps are slow or get lost' in the documentation"
    )
    return lambda _event: log.warning(text)


def describe_topic(node: Node, topic: str, message_type: type) -> str:
    """Return the full name of a topic, with the publisher count or a hint if there is none."""
    name, package = node.resolve_topic_name(topic), message_type.__module__.partition(".")[0]
    kind = f"{package}/msg/{message_type.__name__}"
    types = [info.topic_type for info in node.get_publishers_info_by_topic(name)]
    if kind in types:
        return f"{name} (publishers: {types.count(kind)})"
    text = f"type {types[0]}, but the parameters ask for {kind}" if types else "no publisher"
    known = {
        other: found
        for other, found in node.get_topic_names_and_types()
        if other != name and node.count_publishers(other)
    }
    if similar := [other for other, found in known.items() if kind in found]:
        return f"{name} ({text}; topics of type {kind}: {', '.join(similar[:3])})"
    return f"{name} ({text}{hint(name, known)})"


def listen(
    node: Node,
    message_type: type,
    topic: str,
    callback: Callable[[Any], object],
    log: LogThrottle,
    what: str,
    depth: int = 1,
) -> Callable[[], str]:
    """Subscribe to a topic (best effort); drop and log messages that the callback rejects.

    Returns a function that describes the topic, for warnings about missing messages.
    """

    def receive(message: Any) -> None:
        with dropping(log, f"dropped {what}"):
            callback(message)

    qos = QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)
    node.create_subscription(message_type, topic, receive, qos)
    return partial(describe_topic, node, topic, message_type)


class LatchedSubscription:
    """Subscription that receives the last message of a latched topic and all later messages.

    The subscription is transient local, to receive the last message. It becomes volatile when a
    volatile publisher appears, because that publisher sends nothing to transient-local
    subscriptions.

    The first lost message is logged. If the callback raises a `GridMapError` or a `MemoryError`,
    the message is dropped and the error is logged. A `NodeFailedError` ends the node.

    Args:
        qos: fixed quality of service; None adapts the quality of service to the publishers.
        raw: pass serialized messages (bytes) to the callback.
        hears_best_effort: also switch to best effort when a best-effort publisher appears; if
            False, only log a warning about that publisher.
        depth: queue depth if `qos` is None.
        is_counted: count the messages in the `Health` of the node.
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
        depth: int = 1,
        is_counted: bool = True,
    ) -> None:
        self._node, self._is_counted = node, is_counted
        self.topic_name: str = node.resolve_topic_name(topic)
        self._callback = callback
        self._qos = qos or map_qos()
        if not qos:
            self._qos.depth = depth
        self._can_give_up = [*WEAKER][: 0 if qos else 1 + hears_best_effort]
        offers = [one.qos_profile for one in node.get_publishers_info_by_topic(self.topic_name)]
        for kind in self._can_give_up:
            policy, weaker = kind.name.lower(), WEAKER[kind]
            # A stricter subscription would make the publishers log a warning.
            if offers and all(getattr(offer, policy) == weaker for offer in offers):
                setattr(self._qos, policy, weaker)
        self._log = LogThrottle(node.get_logger())
        self._subscribe = partial(
            node.create_subscription,
            message_type,
            topic,
            self._receive,
            self._qos,
            event_callbacks=SubscriptionEventCallbacks(
                incompatible_qos=self._on_incompatible, message_lost=warn_of_gaps(node, topic)
            ),
            raw=raw,
        )
        self._subscription: Any = self._subscribe()

    def destroy(self) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
            self._subscription = None

    def _receive(self, message: Any) -> None:
        if isinstance(message, bytes) and len(message) > LARGEST_BLOCK:
            keep_memory()
        what = f"dropped a message of {self.topic_name}"
        counted = health_of(self._node).counted() if self._is_counted else nullcontext()
        with dropping(self._log, what), counted:
            self._callback(message)

    def _on_incompatible(self, event: Any) -> None:
        kind, executor = QoSPolicyKind(event.last_policy_kind), self._node.executor
        policy = kind.name.lower()
        if kind not in self._can_give_up:
            self._log.warning(
                f"no messages from a publisher of {self.topic_name}: "
                f"incompatible quality of service ({policy})"
            )
            return

        def subscribe_again() -> None:
            if self._subscription is not None:
                self._node.get_logger().info(
                    f"a publisher of {self.topic_name} is {WEAKER[kind].name.lower()}: now the "
                    "subscription is, too"
                )
                self.destroy()
                self._subscription = self._subscribe()

        if executor is not None and getattr(self._qos, policy) != WEAKER[kind]:
            setattr(self._qos, policy, WEAKER[kind])
            # Deferred, because this is a callback of the subscription that will be destroyed.
            executor.create_task(subscribe_again)


class MapSubscription(LatchedSubscription):
    """Subscription to `grid_map_msgs/GridMap` that also receives the last map of a latched topic.

    The callback receives a `ReceivedMap` and decodes the layers that it needs. If the callback
    raises a `GridMapError`, the map is dropped and the error is logged. A `NodeFailedError` ends
    the node.

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
            node, GridMapMessage, topic, lambda data: callback(ReceivedMap(data)), qos=qos, raw=True
        )


class MapPublisher:
    """Latched publisher that creates messages only while there are subscribers.

    Each new subscriber triggers a publication, because the latched map may be outdated.

    Args:
        topic: name of the map topic.
        serialized: function that returns the current map as a message or as serialized bytes. If
            there is no map yet, the function returns None.
        log: logs the error if a map cannot be published.
        kind: class of the messages.

    Attributes:
        count: number of published messages.
        topic_name: full name of the topic.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        serialized: Callable[[], Any],
        log: LogThrottle,
        *,
        kind: type = GridMapMessage,
    ) -> None:
        self.count = 0
        self._version = 0
        self._serialized, self._log = serialized, log
        events = PublisherEventCallbacks(matched=self._match)
        self._publisher = node.create_publisher(kind, topic, map_qos(), event_callbacks=events)
        self.topic_name: str = self._publisher.topic_name

    def publish(self) -> None:
        """Publish the current map if there are subscribers; log an error if that fails."""
        if not self._publisher.get_subscription_count():
            return
        with dropping(self._log, f"dropped a message for {self.topic_name}"):
            data = self._serialized()
            if data is not None:
                self._publisher.publish(data)
                self.count += 1

    def publish_version(self, version: int) -> None:
        """Publish the current map if `version` differs from the version in the previous call."""
        if version != self._version:
            self._version = version
            self.publish()

    def _match(self, status: Any) -> None:
        if status.total_count_change > 0:
            self.publish()


def offer_service(
    node: Node, kind: type, name: str, action: Callable[[Any, Any], None], log: LogThrottle
) -> None:
    """Create the service `~/name`; `action(request, response)` fills the response.

    If `action` raises a `GridMapError` or a `MemoryError`, the response is empty.
    """

    def respond(request: Any, response: Any) -> Any:
        with dropping(log, name):
            action(request, response)
            return response
        return type(response)()

    node.create_service(kind, f"~/{name}", respond)
