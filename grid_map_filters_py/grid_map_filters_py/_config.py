# SPDX-License-Identifier: BSD-3-Clause
"""YAML configurations of filter chains in the ROS 2 and ROS 1 formats.

A chain is a mapping with the keys `filter1` to `filterN` in ROS 2, and a list in ROS 1. Each step
is a mapping with the keys `name`, `type` and `params`.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from grid_map_core_py._parameters import nested, node_sections
from grid_map_core_py.errors import ConfigError, GridMapError, short
from grid_map_core_py.files._shared import load_yaml

from .errors import FilterConfigError


@dataclass(frozen=True)
class StepConfig:
    """Configuration of one filter of a chain; `number` counts from 1."""

    number: int
    name: str
    type: str
    params: Mapping[str, object] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"filter {self.number} {self.name!r} ({self.type})"


def parse_steps(config: object) -> list[StepConfig]:
    """Return the steps of a chain, given as `{filter1: step, filter2: step, ...}` or as a list."""
    if isinstance(config, Mapping):
        numbered = {}
        for key, entry in config.items():
            match = re.fullmatch("filter([1-9][0-9]{0,5})", str(key))
            if not match:
                raise FilterConfigError(f"filters: expected filter1 .. filterN, got {key!r}")
            numbered[int(match[1])] = entry
        for expected, number in enumerate(sorted(numbered), start=1):
            if number != expected:
                raise FilterConfigError(
                    f"filters: filter{expected} is missing before filter{number}"
                )
        entries = [numbered[number] for number in sorted(numbered)]
    elif isinstance(config, Sequence) and not isinstance(config, str):
        entries = list(config)
    else:
        raise _unexpected("filters", "filter1 .. filterN or a list", config)
    if not entries:
        raise FilterConfigError("filters: expected at least one filter, got none")
    steps, numbers = [_step(*entry) for entry in enumerate(entries, start=1)], dict[str, int]()
    for step in steps:
        first = numbers.setdefault(step.name, step.number)
        if first != step.number:
            raise FilterConfigError(
                f"filter {step.number}: the name {step.name!r} is already used by filter {first}"
            )
    return steps


def read_chain(path: str | Path, name: str) -> object:
    """Read the configuration of the chain called `name` from a YAML file.

    In a ROS 2 parameter file, the chain is one of the `ros__parameters` of a node. In a ROS 1 file,
    it is the top-level entry `name` or the only top-level list. The file may also be a plain list.
    """
    try:
        content = load_yaml(path)
    except GridMapError as error:
        raise FilterConfigError(str(error)) from error
    if isinstance(content, list):
        return content
    if not isinstance(content, Mapping):
        raise _unexpected(path, "a list of filters or a mapping", content)
    try:
        sections = ((node, nested(params)) for node, params in node_sections(content))
        nodes = {node: params for node, params in sections if name in params}
    except ConfigError as error:
        raise FilterConfigError(f"{path}: {error}") from None
    if len(nodes) > 1:
        raise FilterConfigError(f"{path}: more than one node has {name!r}: {', '.join(nodes)}")
    for parameters in [*nodes.values(), content]:
        if name in parameters:
            return parameters[name]
    lists = [value for value in content.values() if isinstance(value, list)]
    if len(lists) != 1:
        raise FilterConfigError(f"{path}: found no filter chain {name!r}")
    return lists[0]


def field_name(name: str) -> str:
    """Return the field name of a parameter, such as `min_value` for `min/value` or `min.value`."""
    return re.sub("[/.]", "_", name)


def flat(parameters: Mapping[object, object]) -> dict[str, object]:
    """Flatten the parameters of a filter into a dict keyed by field name.

    `min: {value: 1}`, `min.value: 1` and the ROS 1 form `min/value: 1` become `min_value: 1`.
    """
    result: dict[str, object] = {}
    for key, value in parameters.items():
        name = field_name(str(key))
        below = flat(value) if isinstance(value, Mapping) else None
        entries = {name: value} if below is None else {f"{name}_{n}": v for n, v in below.items()}
        for entry in entries.keys() & result.keys():
            raise FilterConfigError(f"parameter {entry!r} is given twice, in two spellings")
        result |= entries
    return result


def _step(number: int, entry: object) -> StepConfig:
    place = f"filter {number}"
    if not isinstance(entry, Mapping):
        raise _unexpected(place, "name, type and params", entry)
    for key in entry:
        if key not in ("name", "type", "params"):
            text = f"{place}: unknown entry {key!r}; expected name, type and params"
            raise FilterConfigError(text)
    name, type_name = (_text(place, key, entry.get(key)) for key in ("name", "type"))
    params = entry.get("params")
    if not isinstance(params, Mapping | None):
        raise _unexpected(f"{place} {name!r}: params", "a mapping", params)
    try:
        return StepConfig(number, name, type_name, flat(params or {}))
    except FilterConfigError as error:
        raise FilterConfigError(f"{place} {name!r}: {error}") from None


def _text(place: str, key: str, value: object) -> str:
    if not isinstance(value, str) or not value:
        hint = " (quote it)" if isinstance(value, bool | int | float) else ""
        raise _unexpected(f"{place}: {key}", f"a string{hint}", value)
    return value


def _unexpected(place: object, expected: str, value: object) -> FilterConfigError:
    found = "nothing" if value is None else f"{short(value)} ({type(value).__name__})"
    return FilterConfigError(f"{place}: expected {expected}, got {found}")
