# SPDX-License-Identifier: BSD-3-Clause
"""Typed parameters of a node, read from ROS parameter files."""

import array
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, asdict, fields
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeVar, get_origin, get_type_hints

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.impl.implementation_singleton import rclpy_implementation

from grid_map_core_py._parameters import (
    build,
    cast,
    describe as describe_type,
    descriptions,
    mismatch,
    nested,
    node_sections,
)
from grid_map_core_py.errors import ConfigError, GridMapError, hint
from grid_map_core_py.files._shared import load_yaml
from grid_map_core_py.limits import Limits, set_limits
from grid_map_core_py.plugins import check

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.parameter import Parameter

T = TypeVar("T")


def read_parameter(
    node: "Node",
    name: str,
    kind: type[T],
    default: T | None = None,
    *,
    description: str = "",
    read_only: bool = True,
) -> T:
    """Declare a parameter on the node and return its value.

    Numbers are converted to `kind`: 3 becomes 3.0 for float, and 3.0 becomes 3 for int. An empty
    list counts as not set, unless `kind` is a list.

    Args:
        name: full name, such as `elevation.params.layer`.
        kind: bool, int, float, str, or a list of one of them, such as `list[str]`.
        default: value if the parameter is not set; None makes the parameter required.
        description: text that `ros2 param describe` shows.
        read_only: if False, the parameter can be set later, to a value of any type.

    Raises:
        ConfigError: the parameter is required but not set, or has the wrong type.
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


def read_fields(
    node: "Node",
    cls: type[T],
    prefix: str = "",
    *,
    defaults: Mapping[str, object] | None = None,
    read_only: bool = True,
) -> T:
    """Create an instance of a dataclass from ROS parameters that are named after its fields.

    All fields must have defaults; `defaults` overrides them by field name. The parameter
    descriptions come from the `Attributes:` section of the dataclass. If a value has the wrong type
    or the dataclass rejects it, the function raises `ConfigError`.
    """
    kinds, texts, values = get_type_hints(cls), descriptions(cls), dict[str, Any]()
    for field in fields(cls):  # type: ignore[arg-type]
        default = field.default if field.default_factory is MISSING else field.default_factory()
        values[field.name] = read_parameter(
            node,
            f"{prefix}{field.name}",
            kinds[field.name],
            (defaults or {}).get(field.name, default),
            description=texts[field.name],
            read_only=read_only,
        )
    try:
        return build(cls, values)
    except ConfigError as error:
        raise ConfigError(f"{prefix[:-1]}: {error}" if prefix else str(error)) from error


def follow_changes(node: "Node", settings: T, apply: Callable[[T], None]) -> None:
    """Call `apply` with the new settings when the user changes parameters.

    If the dataclass rejects a change, the parameters keep their values. `settings` must come from
    `read_fields`, without a prefix and with `read_only=False`.
    """
    current = checked = settings

    def check_changes(changes: "list[Parameter]") -> SetParametersResult:
        nonlocal checked
        values: dict[str, Any] = asdict(current)  # type: ignore[call-overload]
        values |= {change.name: change.value for change in changes if change.name in values}
        try:
            checked = build(type(settings), values)
        except GridMapError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def apply_changes(_changes: "list[Parameter]") -> None:
        nonlocal current
        if checked != current:
            current = checked
            apply(current)

    node.add_on_set_parameters_callback(check_changes)
    node.add_post_set_parameters_callback(apply_changes)


def names_below(node: "Node", prefix: str) -> list[str]:
    """Return the sorted names of the parameters one level below a prefix."""
    value = _given(node).get(prefix)
    # The ROS parser turns an empty value into the text "null".
    check(not value or value == "null", prefix, "parameters below it", value)
    below = (name for name in node._parameter_overrides if name.startswith(f"{prefix}."))
    return sorted({name.split(".")[prefix.count(".") + 1] for name in below})


def read_limits(node: "Node") -> None:
    """Set the map limits of the process; call this before the node creates or receives a map."""
    texts = descriptions(Limits)
    limits = {
        name: read_parameter(node, name, int, int(default), description=texts[name])
        for name, default in vars(Limits()).items()
    }
    set_limits(**limits)


def read_parameter_tree(
    node: "Node",
    prefix: str,
    *,
    read_only: bool = True,
    description: str = "",
    describe: Callable[[dict[str, Any]], Mapping[str, str]] | None = None,
) -> dict[str, Any]:
    """Declare all parameters below a prefix and return them as nested dictionaries.

    `filters.filter1.params.radius: 1` under the prefix `filters` becomes
    `{"filter1": {"params": {"radius": 1}}}`. Names may contain any character except the separating
    dot, so `min/value` is a single name. Values keep their types from the file, except that arrays
    become lists. Empty lists, empty mappings and null have no type in ROS, and become None.

    Args:
        prefix: root of the tree.
        read_only: if False, the parameters can be set later, to values of any type; for example,
            `radius: 1` can be changed to 1.5.
        description: text that `ros2 param describe` shows for each parameter.
        describe: function that receives the result and returns descriptions by parameter name
            (without the prefix). All other parameters get `description`.

    Raises:
        ConfigError: a name has both a value and parameters below it.
    """
    given = _given(node)
    below = {name: value for name, value in given.items() if f"{name}.".startswith(f"{prefix}.")}
    # ROS 1 files may contain slashes instead of dots.
    old = {name: value for name, value in given.items() if name.startswith(f"{prefix}/")}
    tree: Any = nested(below | {name.replace("/", "."): value for name, value in old.items()})
    for part in prefix.split("."):
        tree = tree.get(part, {})
    expected = f"{'filter1, filter2, ...' if describe else 'parameters'} below it"
    check(isinstance(tree, dict | None), prefix, expected, tree)
    texts = describe(tree or {}) if describe else {}
    for name, value in (below | old).items():
        text = texts.get(name.removeprefix(f"{prefix}."), description)
        _declare(node, name, value, text, read_only=read_only)
    return tree or {}


def check_topic(node: "Node", name: str, topic: str) -> str:
    """Return `topic`, the value of the parameter `name`; raise a `ConfigError` if it is invalid."""
    try:
        node.resolve_topic_name(topic)
    except rclpy_implementation.RCLError as error:
        raise mismatch(name, "the name of a topic", topic) from error
    return topic


def _given(node: "Node") -> dict[str, Any]:
    # The overrides are public only in nodes that declare them automatically, and such nodes fail to
    # start if the parameter file contains an empty list.
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
        # `value` is the override after conversion, for example from an int in the file to a float.
        node.declare_parameter(name, value, descriptor, ignore_override=True)


def unmatched_files(node: "Node", arguments: Sequence[str]) -> str:
    """Return a warning if a parameter file has no section for a node, and "" otherwise."""
    name, texts = node.get_fully_qualified_name(), []
    # In section names, `*` stands for one name and `**` for any number of names.
    wildcards = {"/**": "(/[^/]+)*", "/*": "/[^/]+"}
    for file, sections in _files(arguments):
        patterns = [
            re.sub(r"/\*\*?|[^/]+|/", lambda m: wildcards.get(m[0], re.escape(m[0])), section)
            for section in sections
        ]
        if not any(re.fullmatch(pattern, name) for pattern in patterns):
            known = ", ".join(sections) or "none"
            texts.append(f"no section of {file} matches {name}; the file has {known}")
    return "; ".join(texts)


def unknown_parameters(node: "Node", arguments: Sequence[str]) -> str:
    """Return a warning about parameters that are set but not declared, or "".

    Sections with wildcards, such as `/**`, are ignored: they may be for other nodes.
    """
    shared = {
        f"{key}."
        for _, sections in _files(arguments)
        for section, parameters in sections.items()
        if "*" in section
        for key in parameters
    }
    declared = {name: name.partition(".")[0] for name in node.get_parameters_by_prefix("")}
    texts = {}
    for name in sorted(node._parameter_overrides):
        is_shared = any(f"{name}.".startswith(prefix) for prefix in shared)
        if name in declared or is_shared or name.startswith("qos_overrides."):
            continue
        root = name.partition(".")[0]
        # An unknown tree is reported once, not for each of its parameters.
        wrong, known = (name, declared) if root in declared.values() else (root, declared.values())
        similar = hint(wrong, known).removeprefix("; ")
        texts[wrong] = f"{wrong!r} ({similar})" if similar else repr(wrong)
    return f"unknown parameters, not used: {', '.join(texts.values())}" if texts else ""


def _files(arguments: Sequence[str]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the name and the sections of each parameter file on a command line."""
    for option, file in pairwise(arguments):
        if option == "--params-file":
            # ROS has read the file, but its parser accepts some files that `load_yaml` rejects.
            with suppress(GridMapError):
                yield file, dict(node_sections(load_yaml(file) or {}))
