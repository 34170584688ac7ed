# SPDX-License-Identifier: BSD-3-Clause
"""ROS node for commands that subscribe or publish."""

import argparse
import math
import os
import re
import time
from collections.abc import Sequence
from typing import Any

import rclpy
from ament_index_python.resources import has_resource
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from grid_map_core_py._commands import CommandError, UsageError, on_end
from grid_map_core_py.errors import short

from ..messages._packages import messages_of
from ..nodes._profile import use_profile

_TYPE = re.compile(r"(?P<package>\w+)/(?P<kind>msg|srv|action)/(?P<name>\w+)", re.ASCII)


class Session:
    """Context manager for a ROS node without parameter services.

    The attribute `ended` is True after SIGINT, SIGTERM or SIGHUP.
    """

    def __init__(self, command: str) -> None:
        self.ended = False
        on_end(self._end)
        use_profile()
        name = f"grid_map_{command}_{os.getpid()}"
        try:
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            self.node = Node(name, enable_rosout=False, start_parameter_services=False)
        except rclpy_implementation.RCLError as error:
            raise CommandError(f"ROS does not start: {error}") from error
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        self.node.destroy_node()
        self._executor.shutdown()
        try_shutdown()

    def _end(self, *_: object) -> None:
        self.ended = True

    def spin(self, seconds: float, *, until_ended: bool = True) -> None:
        """Process callbacks for `seconds`, or until `ended` is set if `until_ended` is true."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            if until_ended and self.ended:
                return
            self._executor.spin_once(timeout_sec=min(left, 0.1))

    def topics(self) -> dict[str, list[str]]:
        """Return the message types of all topics, by topic name."""
        found = self.node.get_topic_names_and_types()
        return {name: sorted(types) for name, types in sorted(found)}

    def publishers(self, topic: str) -> list[Any]:
        """Return the endpoints of other nodes that publish on a topic."""
        return self._of_others(self.node.get_publishers_info_by_topic(topic))

    def subscribers(self, topic: str) -> list[Any]:
        """Return the endpoints of other nodes that subscribe to a topic."""
        return self._of_others(self.node.get_subscriptions_info_by_topic(topic))

    def _of_others(self, endpoints: list[Any]) -> list[Any]:
        return [one for one in endpoints if one.node_name != self.node.get_name()]


def message_class(types: Sequence[str]) -> Any:
    """Return the message class of a topic with the message types `types`.

    Raises:
        CommandError: the topic has several types, or its type is not installed.
    """
    if len(types) != 1:
        raise CommandError(f"expected one type of messages, got {', '.join(types)}")
    found = None
    # The name may come from an untrusted bag or machine, so import only message packages.
    if (match := _TYPE.fullmatch(types[0])) and has_resource("rosidl_interfaces", match["package"]):
        found = getattr(messages_of(match["package"], kind=match["kind"]), match["name"], None)
    if not hasattr(found, "get_fields_and_field_types"):
        raise CommandError(f"the message type {short(types[0])} is not installed")
    return found


def quality(*, reliable: bool, latched: bool, depth: int) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def offers(endpoint: Any) -> dict[str, bool]:
    """Return the publisher flags `reliable` and `latched` (serves late-joining subscribers)."""
    qos = endpoint.qos_profile
    return {
        "reliable": qos.reliability == ReliabilityPolicy.RELIABLE,
        "latched": qos.durability == DurabilityPolicy.TRANSIENT_LOCAL,
    }


def check_positive(options: argparse.Namespace, *names: str) -> None:
    """Raise a `UsageError` unless all given options `names` are positive numbers."""
    for name in names:
        value = getattr(options, name)
        if value is not None and not 0 < value < math.inf:
            raise UsageError(f"--{name}: expected a positive number, got {value:g}")
