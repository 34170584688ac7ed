# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The loader of all YAML files: as ROS reads them, and safe against files that grow in memory."""

import re
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from ..errors import GridMapError

LARGEST = 4 * 2**20
"""Maximum size of a YAML file [bytes]."""

_DEEPEST = 50
"""Maximum number of nested levels; the fast loader crashes on very many."""

_MOST_ALIASED = 100_000
"""Maximum number of values that all aliases of a file stand for."""


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """YAML as ROS reads it: `1e-3` is a number."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def load_yaml(path: str | PathLike[str], largest: int = LARGEST) -> Any:
    """Return the content of a YAML file.

    Numbers such as `1e-3` are read as ROS reads them, and keys are unique.

    Args:
        path: the file; it may be a pipe.
        largest: maximum size [bytes].

    Raises:
        GridMapError: the file is missing, or see `parse_yaml`.
    """
    try:
        with Path(path).open("rb") as file:
            text = file.read(largest + 1)
    except OSError as error:
        raise GridMapError(f"{path}: cannot be read: {error.strerror}") from error
    return parse_yaml(text, path, largest)


def parse_yaml(text: str | bytes, name: object, largest: int = LARGEST) -> Any:
    """Return the content of a YAML text; `name` names it in errors.

    Raises:
        GridMapError: the text is too large, nested too deeply, or no YAML, a key occurs twice, or
            aliases stand for too many values.
    """
    if len(text) > largest:
        raise GridMapError(f"{name}: larger than {largest} bytes")
    try:
        _check(text)
        return yaml.load(text, _Loader)
    except _RefusedError as error:
        raise GridMapError(f"{name}: {error}") from None
    # PyYAML raises ValueError for a date that does not exist.
    except (yaml.YAMLError, ValueError) as error:
        problem = " ".join(str(error).split())
        raise GridMapError(f"{name}: no valid YAML: {problem:.300}") from error


class _RefusedError(Exception):
    """A YAML text that would take too much memory, or repeats a key."""


@dataclass
class _Level:
    """A list or mapping while it is parsed.

    Attributes:
        anchor: its name for aliases.
        keys: names of a mapping; None for a list.
        is_key: the next value is a key.
        count: number of values in it; aliases count as what they stand for.
    """

    anchor: str | None = None
    keys: set[str] | None = None
    is_key: bool = False
    count: int = 1


@dataclass
class _Check:
    """Follows the events of the parser, before anything is built."""

    levels: list[_Level] = field(default_factory=lambda: [_Level()])
    counts: dict[str, int] = field(default_factory=dict)
    aliased: int = 0

    def value(self, event: Any, anchor: str | None, count: int) -> None:
        """Count a complete value, and remember the key of a mapping."""
        if anchor is not None:
            self.counts[anchor] = count
        level, is_text = self.levels[-1], isinstance(event, yaml.ScalarEvent)
        level.count += count
        if level.keys is not None:
            level.is_key = not level.is_key
            if not level.is_key and is_text:
                if event.value in level.keys:
                    line = event.start_mark.line + 1
                    raise _RefusedError(f"{event.value!r:.100} occurs twice, again in line {line}")
                level.keys.add(event.value)

    def alias(self, event: Any) -> None:
        if event.anchor in [level.anchor for level in self.levels]:
            raise _RefusedError(f"the alias {event.anchor!r:.100} stands for itself")
        count = self.counts.get(event.anchor, 1)
        self.aliased += count
        if self.aliased > _MOST_ALIASED:
            raise _RefusedError(f"aliases stand for more than {_MOST_ALIASED} values")
        self.value(event, None, count)


def _check(text: str | bytes) -> None:
    check = _Check()
    for event in yaml.parse(text, _Loader):
        if isinstance(event, yaml.ScalarEvent):
            check.value(event, event.anchor, 1)
        elif isinstance(event, yaml.AliasEvent):
            check.alias(event)
        elif isinstance(event, yaml.CollectionStartEvent):
            is_mapping = isinstance(event, yaml.MappingStartEvent)
            check.levels.append(_Level(event.anchor, set() if is_mapping else None, is_mapping))
            if len(check.levels) > _DEEPEST + 1:
                raise _RefusedError(f"nested more than {_DEEPEST} times")
        elif isinstance(event, yaml.CollectionEndEvent):
            level = check.levels.pop()
            check.value(event, level.anchor, level.count)
