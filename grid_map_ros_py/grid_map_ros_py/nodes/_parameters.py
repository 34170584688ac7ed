# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Typed parameters of a node, from the ordinary ROS parameter file.

Everything that is read here is declared on the node, so that `ros2 param list` shows it, and is
read-only unless said otherwise: nodes configure themselves once, when they start.
"""

import array
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar, get_origin

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.impl.implementation_singleton import rclpy_implementation

from grid_map_core_py.plugins import cast, check, describe, mismatch

if TYPE_CHECKING:
    from rclpy.node import Node

T = TypeVar("T")

EXTREMES = (1e-9, 1e9)
"""Smallest and largest positive parameter: the period of such a rate still fits a ROS timer."""


def read_parameter(
    node: "Node", name: str, kind: type[T], default: T | None = None, *, description: str = ""
) -> T:
    """Return one parameter, declared on the node.

    Args:
        node: an integer given for a float, and a whole number such as 3.0 given for an integer, are
            converted. A value without type, which is what an empty list in the file becomes, is the
            empty list for list kinds and counts as not given for others.
        name: full name, such as `elevation.params.layer`.
        kind: bool, int, float, str, or a list of one of them, such as `list[str]`.
        default: the value if none is given; None makes the parameter required.
        description: text that `ros2 param describe` shows.

    Raises:
        ConfigError: the parameter is required but not given, or has another type.
    """
    given = _given(node, (name,))
    value = given.get(name)
    if value is None and not (name in given and get_origin(kind) is list):
        if default is None:
            raise mismatch(name, describe(kind), None)
        value = default
    typed: T = cast(name, value, kind)
    _declare(node, name, typed, description)
    return typed


def read_positive(node: "Node", name: str, default: float, *, description: str = "") -> float:
    """Return a parameter that is a positive number, such as a rate or a time.

    Raises:
        ConfigError: it is none, or beyond `EXTREMES`.
    """
    value = read_parameter(node, name, float, default, description=description)
    low, high = EXTREMES
    check(low <= value <= high, name, f"a positive number from {low:g} to {high:g}", value)
    return value


def read_parameter_tree(
    node: "Node", prefix: str, *, read_only: bool = True, description: str = ""
) -> dict[str, Any]:
    """Return all parameters below a prefix as nested dictionaries, declared on the node.

    `filters.filter1.params.radius: 1` under the prefix `filters` becomes
    `{"filter1": {"params": {"radius": 1}}}`. Names may hold any character but the separating dot,
    so `min/value` stays one name. Values keep the type that the file gave them, which
    `grid_map_core_py.plugins` casts; arrays become lists. An empty list, an empty mapping and null
    all arrive without type, as None.

    Args:
        node: the node.
        prefix: name of the tree.
        read_only: False lets the parameters be set later, to values of any type: `radius: 1` is an
            integer that may become 1.5.
        description: text that `ros2 param describe` shows for each of them.

    Raises:
        ConfigError: a name is given both a value and parameters below it.
    """
    tree: dict[str, Any] = {}
    known = dict.fromkeys((*_overrides(node), *node.get_parameters_by_prefix("")))
    names = [name for name in known if not prefix or f"{name}.".startswith(f"{prefix}.")]
    for name, value in _given(node, names).items():
        _declare(node, name, value, description, read_only=read_only)
        _insert(tree, name.removeprefix(prefix).split(".")[1:], value, name)
    return tree


def check_topic(node: "Node", name: str, topic: str) -> str:
    """Return `topic`, the value of a parameter, if the node can publish or subscribe to it.

    For topics that a node uses only while an output has a subscriber.

    Raises:
        ConfigError: it cannot; the message names the parameter.
    """
    try:
        node.resolve_topic_name(topic)
    except rclpy_implementation.RCLError as error:
        raise mismatch(name, "the name of a topic", topic) from error
    return topic


def _given(node: "Node", names: Iterable[str]) -> dict[str, Any]:
    """Return the values of those parameters that the node has declared or was started with."""
    overrides = _overrides(node)
    given = {
        name: node.get_parameter(name) if node.has_parameter(name) else overrides.get(name)
        for name in names
    }
    return {
        name: list(entry.value) if isinstance(entry.value, array.array) else entry.value
        for name, entry in given.items()
        if entry is not None
    }


def _overrides(node: "Node") -> Mapping[str, Any]:
    # Declaring all overrides automatically is the public way to see names that are not known
    # beforehand, but a node made so cannot start when its file holds an empty list.
    overrides: Mapping[str, Any] = node._parameter_overrides
    return overrides


def _declare(
    node: "Node", name: str, value: object, description: str = "", *, read_only: bool = True
) -> None:
    if not node.has_parameter(name):
        descriptor = ParameterDescriptor(
            description=description,
            read_only=read_only,
            dynamic_typing=value is None or not read_only,
        )
        # The value is the override, converted: the file's own may be an int for a float.
        node.declare_parameter(name, value, descriptor, ignore_override=True)


def _insert(tree: dict[str, Any], path: list[str], value: object, name: str) -> None:
    if not path:
        if value is not None:
            raise mismatch(name, "parameters below it", value)
        return
    *parents, leaf = path
    for parent in parents:
        tree = tree.setdefault(parent, {})
        if not isinstance(tree, dict):
            raise mismatch(name, f"no value for {parent!r} itself", tree)
    if leaf in tree:
        raise mismatch(name, "no parameters below it", tree[leaf])
    tree[leaf] = value
