# SPDX-License-Identifier: BSD-3-Clause
"""Typed parameters of a node, from the ordinary ROS parameter file.

Everything that is read here is declared on the node, so that `ros2 param list` shows it, and is
read-only unless said otherwise: nodes configure themselves once, when they start.
"""

import array
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeVar, get_origin

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.impl.implementation_singleton import rclpy_implementation

from grid_map_core_py._parameters import cast, describe as describe_type, mismatch, nested
from grid_map_core_py.limits import Limits, set_limits
from grid_map_core_py.plugins import check

if TYPE_CHECKING:
    from rclpy.node import Node

T = TypeVar("T")

EXTREMES = (1e-9, 1e9)
"""Smallest and largest positive parameter: the period of such a rate still fits a ROS timer."""


def read_parameter(
    node: "Node",
    name: str,
    kind: type[T],
    default: T | None = None,
    *,
    description: str = "",
    read_only: bool = True,
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
        read_only: False lets the parameter be set later, to a value of any type.

    Raises:
        ConfigError: the parameter is required but not given, or has another type.
    """
    given = _given(node)
    value = given.get(name)
    if value is None and not (name in given and get_origin(kind) is list):
        if default is None:
            raise mismatch(name, describe_type(kind), None)
        value = default
    typed: T = cast(name, value, kind)
    _declare(node, name, typed, description, read_only=read_only)
    return typed


def names_below(node: "Node", prefix: str) -> list[str]:
    """Return the names of the parameters directly below a prefix, sorted.

    Raises:
        ConfigError: the prefix itself has a value other than an empty list.
    """
    value = _given(node).get(prefix)
    check(not value, prefix, "parameters below it", value)
    below = (name for name in node._parameter_overrides if name.startswith(f"{prefix}."))
    return sorted({name.split(".")[prefix.count(".") + 1] for name in below})


def read_positive(node: "Node", name: str, default: float, *, description: str = "") -> float:
    """Return a parameter that is a positive number, such as a rate or a time.

    Raises:
        ConfigError: it is none, or beyond `EXTREMES`.
    """
    value = read_parameter(node, name, float, default, description=description)
    low, high = EXTREMES
    check(low <= value <= high, name, f"a positive number from {low:g} to {high:g}", value)
    return value


def read_limits(node: "Node") -> None:
    """Set the limits of maps (`grid_map_core_py.limits`) from the parameters of the same names.

    Limits hold for the process, so that the node calls this before it makes or receives a map.

    Raises:
        ConfigError: a parameter is less than 1, or no number.
    """
    made = "a map that is received, read from a file or made"
    abouts = {
        "max_cells": f"largest number of cells of {made}",
        "max_bytes": f"largest size [bytes] of all layers of {made}, and of unpacked data",
        "max_ratio": "largest quotient of unpacked and packed bytes of data of more than 100 MB",
    }
    set_limits(
        **{
            name: read_parameter(node, name, int, int(getattr(Limits, name)), description=about)
            for name, about in abouts.items()
        }
    )


def read_parameter_tree(
    node: "Node",
    prefix: str,
    *,
    read_only: bool = True,
    description: str = "",
    describe: Callable[[dict[str, Any]], Mapping[str, str]] | None = None,
) -> dict[str, Any]:
    """Return all parameters below a prefix as nested dictionaries, declared on the node.

    `filters.filter1.params.radius: 1` under the prefix `filters` becomes
    `{"filter1": {"params": {"radius": 1}}}`. Names may hold any character but the separating dot,
    so `min/value` stays one name. Values keep the type that the file gave them, which
    `cast` of the core casts; arrays become lists. An empty list, an empty mapping and null
    all arrive without type, as None.

    Args:
        node: the node.
        prefix: name of the tree.
        read_only: False lets the parameters be set later, to values of any type: `radius: 1` is an
            integer that may become 1.5.
        description: text that `ros2 param describe` shows for each of them.
        describe: takes the dictionaries, and returns other texts by name, without the prefix.

    Raises:
        ConfigError: a name is given both a value and parameters below it.
    """
    given = _given(node)
    below = {name: value for name, value in given.items() if f"{name}.".startswith(f"{prefix}.")}
    # ROS 1 files may have slashes in place of the dots.
    old = {name: value for name, value in given.items() if name.startswith(f"{prefix}/")}
    tree: Any = nested(below | {name.replace("/", "."): value for name, value in old.items()})
    for part in prefix.split("."):
        tree = tree.get(part, {})
    check(isinstance(tree, dict | None), prefix, "parameters below it", tree)
    texts = describe(tree or {}) if describe else {}
    for name, value in (below | old).items():
        text = texts.get(name.removeprefix(f"{prefix}."), description)
        _declare(node, name, value, text, read_only=read_only)
    return tree or {}


def read_topic(node: "Node", name: str, default: str, *, description: str = "") -> str:
    """Return a parameter that is the name of a topic; if the default is empty, it may be, too.

    Raises:
        ConfigError: the node can neither publish nor subscribe to it.
    """
    topic = read_parameter(node, name, str, default, description=description)
    return check_topic(node, name, topic) if topic or default else ""


def check_topic(node: "Node", name: str, topic: str) -> str:
    """Return `topic`, made from the parameter `name`, if it is a valid name of a topic.

    Raises:
        ConfigError: it is not.
    """
    try:
        node.resolve_topic_name(topic)
    except rclpy_implementation.RCLError as error:
        raise mismatch(name, "the name of a topic", topic) from error
    return topic


def _given(node: "Node") -> dict[str, Any]:
    """Return the values of all parameters that the node was started with or has declared."""
    # Declaring all overrides automatically is the public way to see names that are not known
    # beforehand, but a node made so cannot start when its file holds an empty list.
    given = {**node._parameter_overrides, **node.get_parameters_by_prefix("")}
    return {
        name: list(entry.value) if isinstance(entry.value, array.array) else entry.value
        for name, entry in given.items()
    }


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
