# SPDX-License-Identifier: BSD-3-Clause
"""Check parameters from YAML and ROS, and cast them to the types of dataclass fields.

For example, `1` becomes a float, `3.0` an integer, and a list a tuple.
"""

import functools
import inspect
import numbers
import re
import types
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, fields
from typing import Any, Literal, TypeVar, get_args, get_origin

from .errors import ConfigError, hint, short

T = TypeVar("T")

DEEPEST = 50
"""Maximum nesting depth of parameters and YAML, which are processed recursively."""


def build(cls: type[T], parameters: Mapping[str, object]) -> T:
    """Create an instance of the dataclass `cls` from parameters, or raise `ConfigError`.

    Field types may be `bool`, `int`, `float`, `str`, `Literal`, and `tuple[X, ...]`, `list[X]` or
    `X | None` of these types.
    """
    _check_names(cls, parameters)
    types_of = typing.get_type_hints(cls)
    return cls(**{name: cast(name, value, types_of[name]) for name, value in parameters.items()})


def _check_names(cls: type, parameters: Iterable[str]) -> None:
    known = {f.name: f for f in fields(cls) if f.init}
    for name in parameters:
        if name not in known:
            names = ", ".join(known) or "(none)"
            raise ConfigError(f"unknown parameter {name!r}; known: {names}{hint(name, known)}")
    for name, declared in known.items():
        is_required = declared.default is MISSING and declared.default_factory is MISSING
        if is_required and name not in parameters:
            raise ConfigError(f"missing parameter {name!r}")


def with_checked_names(cls: type[T]) -> type[T]:
    """Class decorator that makes a keyword-only dataclass check its parameter names."""
    create: Any = cls.__init__

    @functools.wraps(create)
    def checked(self: object, **parameters: object) -> None:
        _check_names(cls, parameters)
        create(self, **parameters)

    cls.__init__ = checked  # type: ignore[method-assign]
    return cls


def descriptions(cls: type) -> dict[str, str]:
    """Return the texts under `Attributes:` in the docstrings of a class and its bases."""
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        _, _, rest = inspect.cleandoc(base.__doc__ or "").partition("\nAttributes:\n")
        section = re.match(r"(?:    .*\n?)*", rest)
        for names, text in re.findall(
            r"^    (\w[\w, ]*): (.*(?:\n {8}.*)*)", section[0] if section else "", re.MULTILINE
        ):
            found |= dict.fromkeys(names.split(", "), " ".join(text.split()).rstrip("."))
    return found


def node_sections(content: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the full name, such as `/robot/viewer`, and the parameters of each node."""
    for key, value in content.items():
        if key == "ros__parameters" and isinstance(value, Mapping):
            yield path or "/", value
        elif isinstance(value, Mapping):
            yield from node_sections(value, f"{path}/{key}".replace("//", "/"))


def nested(parameters: Mapping[str, object], above: int = 0) -> dict[str, Any]:
    """Convert parameters with dotted names, `a.b: 1`, to nested mappings, `a: {b: 1}`.

    There may be at most `DEEPEST` levels, including `above` enclosing levels.
    """
    result: dict[str, Any] = {}
    expected = "no value, as there are parameters below it"
    for name, value in parameters.items():
        *parents, last = path = str(name).split(".")
        level = above + len(path)
        check(level <= DEEPEST, str(name), f"at most {DEEPEST} nested levels", level)
        place = result
        for depth, parent in enumerate(path if isinstance(value, Mapping) else parents, start=1):
            inner = place.get(parent)
            check(isinstance(inner, dict | None), ".".join(path[:depth]), expected, inner)
            place[parent] = place = inner or {}
        if isinstance(value, Mapping):
            place.update(nested(value, level))
        elif not isinstance(place.get(last), dict):
            place[last] = value
        else:
            # ROS reads an empty mapping `a: {}` as None.
            check(value is None, name, expected, value)
    return result


def cast(name: str, value: object, kind: Any) -> Any:
    """Cast a parameter value to a type supported by `build`, or raise `ConfigError`."""
    result = _try_cast(value, kind)
    if result is MISSING:
        # ROS reads y, n, yes, no, on and off as booleans.
        is_text = kind is str or (get_origin(kind) is Literal and str in map(type, get_args(kind)))
        unquoted = is_text and isinstance(value, bool | int | float)
        raise mismatch(name, describe(kind) + (" (quote it)" if unquoted else ""), value)
    return result


def mismatch(name: str, expected: str, value: object) -> ConfigError:
    found = "nothing" if value is None else f"{short(value)} ({type(value).__name__})"
    return ConfigError(f"parameter {name!r}: expected {expected}, got {found}")


def check(condition: bool, name: str, expected: str, value: object) -> None:
    """Raise a `ConfigError` for the parameter `name` unless `condition` is true."""
    if not condition:
        raise mismatch(name, expected, value)


def _try_cast(value: object, kind: Any) -> object:
    """Return the cast value, or MISSING if it does not fit the type."""
    origin = get_origin(kind)
    if origin is Literal:
        return value if value in get_args(kind) else MISSING
    if origin in (types.UnionType, typing.Union):
        casts = (_try_cast(value, option) for option in get_args(kind))
        return next((cast for cast in casts if cast is not MISSING), MISSING)
    if origin in (tuple, list):
        if value is None:  # ROS reads an empty list as None.
            return origin()
        if not isinstance(value, list | tuple):
            return MISSING
        items = [_try_cast(item, get_args(kind)[0]) for item in value]
        return MISSING if MISSING in items else origin(items)
    is_number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    if kind is float and is_number:
        return float(typing.cast("float", value))
    if kind is int:
        # NumPy integers are `Integral` too.
        is_whole = isinstance(value, numbers.Integral) and is_number
        is_whole |= isinstance(value, float) and value.is_integer()
        return int(typing.cast("int", value)) if is_whole else MISSING
    return value if isinstance(value, kind) else MISSING


def describe(kind: Any) -> str:
    """Describe a type supported by `build`, for error messages."""
    origin = get_origin(kind)
    if origin is Literal:
        return "one of " + ", ".join(map(repr, get_args(kind)))
    if origin in (types.UnionType, typing.Union):
        return " or ".join(describe(option) for option in get_args(kind))
    if origin in (tuple, list):
        return f"a list, each item {describe(get_args(kind)[0])}"
    names = {float: "a number", int: "an integer", str: "a string", bool: "true or false"}
    return names.get(kind, "nothing" if kind is types.NoneType else kind.__name__)
