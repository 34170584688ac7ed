# SPDX-License-Identifier: BSD-3-Clause
"""The loader of all YAML files: as ROS reads them, and safe against files that grow in memory."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

import yaml

from .._parameters import DEEPEST
from ..errors import GridMapError
from ._shared import refuse_devices

LARGEST = 4 * 2**20
"""Maximum size of a YAML file [bytes]."""

MOST_VALUES = 100_000
"""Maximum number of values and keys; an alias counts as the values that it stands for."""

_MOST_TAGS = 100
"""Maximum number of `%TAG` directives, for which libyaml takes quadratic time."""

_LONGEST_TAG = 100
"""Maximum number of characters of a tag, of which a `%TAG` directive can make long copies."""

_LONGEST_NUMBER = 100
"""Maximum number of characters of a number."""

_BITS = 64
"""Maximum number of bits of an integer. A mapping takes quadratic time for chosen larger keys."""


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """YAML as ROS reads it: `1e-3` is a number."""


def _naming_place(construct: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return a constructor that raises YAMLError with the place for all that a value can raise."""

    def construct_or_refuse(loader: Any, node: Any) -> Any:
        try:
            return construct(loader, node)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            problem = f"{node.value!r:.100} is no {node.tag.rpartition(':')[2]}"
            # Others tell of the code, not of the value.
            problem += f": {error}" if isinstance(error, ValueError) else ""
            raise yaml.constructor.ConstructorError(None, None, problem, node.start_mark) from error

    return construct_or_refuse


def _number(construct: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return a constructor of numbers that refuses long ones at once."""

    def construct_short(loader: Any, node: Any) -> Any:
        if len(node.value) > _LONGEST_NUMBER:
            raise ValueError(f"expected at most {_LONGEST_NUMBER} characters")
        number = construct(loader, node)
        if isinstance(number, int) and number.bit_length() > _BITS:
            raise ValueError(f"expected at most {_BITS} bits")
        return number

    return construct_short


for _tag, _construct in _Loader.yaml_constructors.items():
    _is_number = _tag in ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
    _limited = _number(_construct) if _is_number else _construct
    _Loader.add_constructor(_tag, _naming_place(_limited))

_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)[eE][-+]?[0-9]+$"),
    list("-+.0123456789"),
)


def load_yaml(path: str | PathLike[str], *, piped: bool = False) -> Any:
    """Return the content of a YAML file.

    Numbers such as `1e-3` are read as ROS reads them, and keys are unique.

    Args:
        path: the file.
        piped: let it be a pipe or a device, which may never end.

    Raises:
        GridMapError: the file is missing, or see `parse_yaml`.
    """
    try:
        if not piped:
            refuse_devices(Path(path))
        with Path(path).open("rb") as file:
            text = file.read(LARGEST + 1)
    except OSError as error:
        raise GridMapError(f"{path}: cannot be read: {error.strerror or error}") from error
    return parse_yaml(text, path)


def parse_yaml(text: str | bytes, name: object) -> Any:
    """Return the content of a YAML text; `name` names it in errors.

    Raises:
        GridMapError: the text is too large, has too many values, is nested too deeply, or is no
            YAML, or a key occurs twice.
    """
    if len(text) > LARGEST:
        raise GridMapError(f"{name}: larger than {LARGEST} bytes")
    # Without NUL, UTF-16 has the bytes of ASCII.
    plain = text if isinstance(text, str) else text.replace(b"\0", b"").decode("latin-1")
    if plain.count("%TAG") > _MOST_TAGS:
        raise GridMapError(f"{name}: more than {_MOST_TAGS} times %TAG")
    try:
        _check(text)
        return yaml.load(text, _Loader)
    except _RefusedError as error:
        raise GridMapError(f"{name}: {error}") from None
    # Characters that are no Unicode raise ValueError.
    except (yaml.YAMLError, ValueError) as error:
        problem = " ".join(str(error).split())
        raise GridMapError(f"{name}: no valid YAML: {problem:.300}") from error


class _RefusedError(Exception):
    """A YAML text that would take too much memory, or repeats a key."""


@dataclass(slots=True)
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
    total: int = 0

    def add(self, count: int) -> None:
        """Add to the number of all values."""
        self.total += count
        if self.total > MOST_VALUES:
            raise _RefusedError(f"more than {MOST_VALUES} values")

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
        self.add(count)
        self.value(event, None, count)


def _check(text: str | bytes) -> None:
    check = _Check()
    for event in yaml.parse(text, _Loader):
        if len(getattr(event, "tag", None) or "") > _LONGEST_TAG:
            raise _RefusedError(f"a tag of more than {_LONGEST_TAG} characters")
        match event:
            case yaml.ScalarEvent():
                check.add(1)
                check.value(event, event.anchor, 1)
            case yaml.AliasEvent():
                check.alias(event)
            case yaml.CollectionStartEvent():
                check.add(1)
                is_mapping = isinstance(event, yaml.MappingStartEvent)
                check.levels.append(_Level(event.anchor, set() if is_mapping else None, is_mapping))
                if len(check.levels) > DEEPEST + 1:
                    raise _RefusedError(f"nested more than {DEEPEST} times")
            case yaml.CollectionEndEvent():
                level = check.levels.pop()
                check.value(event, level.anchor, level.count)
