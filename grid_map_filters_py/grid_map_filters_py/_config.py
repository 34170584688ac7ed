# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Chain configurations as YAML writes them, in the forms of ROS 2 and ROS 1.

ROS 2 knows no lists of mappings, so a chain is a mapping `filter1 .. filterN` there. In ROS 1 it is
a plain list. Both hold steps of the form `{name, type, params}`.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from .errors import FilterConfigError

_KEY = re.compile(r"filter([1-9][0-9]*)")


@dataclass(frozen=True)
class StepConfig:
    """One filter of a chain as it was configured; `number` counts from 1."""

    number: int
    name: str
    type: str
    params: Mapping[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"filter {self.number} {self.name!r} ({self.type})"


def parse_steps(config: object) -> list[StepConfig]:
    """Return the steps of a chain in the order in which they run.

    Args:
        config: the mapping `{filter1: step, filter2: step, ...}` or a list of steps.

    Raises:
        FilterConfigError: naming the filter, what was expected and what was found.
    """
    if isinstance(config, Mapping):
        entries = _numbered(config)
    elif isinstance(config, Sequence) and not isinstance(config, str):
        entries = list(config)
    else:
        raise FilterConfigError(
            f"filters: expected filter1 .. filterN or a list, found {_found(config)}"
        )
    if not entries:
        raise FilterConfigError("filters: expected at least one filter, found none")
    steps = [_step(number, entry) for number, entry in enumerate(entries, start=1)]
    _check_names(steps)
    return steps


def read_chain(path: str | Path, name: str) -> object:
    """Return the configuration of the chain called `name` in a YAML file.

    A ROS 2 parameter file holds it among the `ros__parameters` of a node. In a ROS 1 file it is the
    entry `name` at the top, or the only list there.

    Raises:
        FilterConfigError: the file is no YAML, or it does not hold exactly one such chain.
        OSError: the file cannot be read.
    """
    content = _load(Path(path))
    if not isinstance(content, Mapping):
        raise FilterConfigError(f"{path}: expected a YAML mapping, found {_found(content)}")
    try:
        nodes = {node: params for node, params in _ros_parameters(content) if name in params}
    except FilterConfigError as error:
        raise FilterConfigError(f"{path}: {error}") from None
    if len(nodes) > 1:
        raise FilterConfigError(f"{path}: more than one node has {name!r}: {', '.join(nodes)}")
    for parameters in nodes.values():
        return parameters[name]
    if name in content:
        return content[name]
    lists = [value for value in content.values() if isinstance(value, list)]
    if len(lists) != 1:
        raise FilterConfigError(f"{path}: found no filter chain {name!r}")
    return lists[0]


def _load(path: Path) -> object:
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_Loader)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise FilterConfigError(f"{path}: not valid YAML: {error}") from error


class _Loader(yaml.SafeLoader):
    """YAML as ROS reads it: `1e-3` is a number. A key that occurs twice is an error."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        # Here, because later the keys that `<<` merges into a mapping stand beside its own.
        node: yaml.MappingNode = super().compose_mapping_node(anchor)
        keys = [key.value for key, _ in node.value if isinstance(key, yaml.ScalarNode)]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.YAMLError(f"{key!r} occurs twice{node.start_mark}")
        return node


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    "-+.0123456789",
)


def _ros_parameters(content: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the name and the parameters of every node in a parameter file."""
    for key, value in content.items():
        if key == "ros__parameters" and isinstance(value, Mapping):
            yield path or "/", nested(value)
        elif isinstance(value, Mapping):
            yield from _ros_parameters(value, f"{path}/{key}".replace("//", "/"))


def nested(parameters: Mapping[str, object]) -> dict[str, Any]:
    """Return parameters with dots in their names, `a.b: 1`, as mappings, `a: {b: 1}`.

    None, as which an empty mapping in a ROS parameter file arrives, gives way to a mapping.

    Raises:
        FilterConfigError: a parameter has both a value and parameters below it.
    """
    result: dict[str, Any] = {}
    for name, value in parameters.items():
        *parents, last = str(name).split(".")
        place = result
        for parent in parents:
            place = _below(place, parent, name)
        if isinstance(value, Mapping):
            _below(place, last, name).update(nested(value))
        elif not isinstance(place.get(last), dict):
            place[last] = value
        elif value is not None:
            raise _both(name, last, value)
    return result


def _below(place: dict[str, Any], key: str, name: object) -> dict[str, Any]:
    inner = {} if place.get(key) is None else place[key]
    place[key] = inner
    if not isinstance(inner, dict):
        raise _both(name, key, inner)
    return inner


def flat(parameters: Mapping[object, object]) -> dict[str, object]:
    """Return the parameters of a filter with names that its fields can have.

    `min: {value: 1}`, ROS 1's `min/value: 1` and `min.value: 1` become `min_value: 1`.

    Raises:
        FilterConfigError: two spellings of one parameter.
    """
    result: dict[str, object] = {}
    for key, value in parameters.items():
        name = re.sub("[/.]", "_", str(key))
        below = flat(value) if isinstance(value, Mapping) else None
        entries = {name: value} if below is None else {f"{name}_{n}": v for n, v in below.items()}
        for entry in entries.keys() & result.keys():
            raise FilterConfigError(f"parameter {entry!r} is given twice, in two spellings")
        result |= entries
    return result


def _both(name: object, key: str, value: object) -> FilterConfigError:
    return FilterConfigError(f"{name}: {key!r} has a value, {value!r}, and parameters below it")


def _numbered(config: Mapping[object, object]) -> list[object]:
    """Return the entries filter1 .. filterN in numeric order."""
    numbers = {}
    for key, entry in config.items():
        match = _KEY.fullmatch(str(key))
        if not match:
            raise FilterConfigError(f"filters: expected filter1 .. filterN, found {key!r}")
        numbers[int(match[1])] = entry
    for expected, number in enumerate(sorted(numbers), start=1):
        if number != expected:
            raise FilterConfigError(f"filters: filter{expected} is missing before filter{number}")
    return [numbers[number] for number in sorted(numbers)]


def _step(number: int, entry: object) -> StepConfig:
    if not isinstance(entry, Mapping):
        raise FilterConfigError(
            f"filter {number}: expected name, type and params, found {_found(entry)}"
        )
    for key in entry:
        if key not in ("name", "type", "params"):
            raise FilterConfigError(
                f"filter {number}: unknown entry {key!r}; expected name, type and params"
            )
    name, type_name = (_text(number, entry, key) for key in ("name", "type"))
    params = entry.get("params")
    if params is not None and not isinstance(params, Mapping):
        raise FilterConfigError(
            f"filter {number} {name!r}: params: expected a mapping, found {_found(params)}"
        )
    try:
        return StepConfig(number, name, type_name, flat(params or {}))
    except FilterConfigError as error:
        raise FilterConfigError(f"filter {number} {name!r}: {error}") from None


def _text(number: int, entry: Mapping[object, object], key: str) -> str:
    value = entry.get(key)
    if not isinstance(value, str) or not value:
        hint = " (quote it)" if isinstance(value, bool | int | float) else ""
        raise FilterConfigError(
            f"filter {number}: {key}: expected a string{hint}, found {_found(value)}"
        )
    return value


def _check_names(steps: list[StepConfig]) -> None:
    first: dict[str, StepConfig] = {}
    for step in steps:
        other = first.setdefault(step.name, step)
        if other is not step:
            raise FilterConfigError(
                f"filter {step.number}: the name {step.name!r} is already that of "
                f"filter {other.number}"
            )


def _found(value: object) -> str:
    return "nothing" if value is None else f"{value!r} ({type(value).__name__})"
