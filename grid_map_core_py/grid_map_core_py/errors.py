# SPDX-License-Identifier: BSD-3-Clause
"""Error classes of this package, and helpers that format error messages.

GridMapError
├── LayerNotFoundError (KeyError)
├── OutOfMapError (IndexError)
├── GeometryError (ValueError)
├── ConfigError (ValueError)
├── LimitError (ValueError)
└── MissingPackageError (ImportError)
"""

import difflib
import math
import reprlib
from collections.abc import Iterable
from importlib import import_module
from itertools import islice
from typing import Any

from ._packages import remedy_for

__all__ = [
    "ConfigError",
    "GeometryError",
    "GridMapError",
    "LayerNotFoundError",
    "LimitError",
    "MissingPackageError",
    "OutOfMapError",
]


class GridMapError(Exception):
    """Base class of all errors that the grid_map packages raise.

    `str(error)` shortens the message to 500 characters. `error.whole_text()` returns all of it.
    """

    def __str__(self) -> str:
        return cut(self.whole_text())

    def whole_text(self) -> str:
        """Return the error message without shortening it."""
        return super().__str__()


class LayerNotFoundError(GridMapError, KeyError):
    """A requested layer is not in the map."""

    def __init__(self, layer: object, available: Iterable[str]) -> None:
        self.layer = layer
        self.available = tuple(available)
        super().__init__(layer, self.available)

    def whole_text(self) -> str:
        names = ", ".join(self.available) or "(none)"
        return f"no layer {self.layer!r}; available: {names}{hint(self.layer, self.available)}"


class OutOfMapError(GridMapError, IndexError):
    """A position or an index is outside the map."""


class GeometryError(GridMapError, ValueError):
    """A size, length, resolution, position or array shape is invalid."""


class ConfigError(GridMapError, ValueError):
    """A parameter is unknown, missing, or has a wrong type or value."""


class LimitError(GridMapError, ValueError):
    """A message, a file or a request exceeds the limits in `grid_map_core_py.limits`."""


class MissingPackageError(GridMapError, ImportError):
    """A feature needs a package that is not installed."""

    def __init__(self, package: str, feature: str, remedy: str = "") -> None:
        self.package = package
        super().__init__(package, feature, remedy or remedy_for(package))

    def whole_text(self) -> str:
        package, feature, remedy = self.args
        return f"{feature} needs the package {package!r}, which is not installed: {remedy}"


_LONGEST = 80  # maximum number of characters of a value in a message
_LONGEST_TEXT, _END = 500, 100  # maximum length of a message; length of the end that `cut` keeps
_MOST_NAMES = 1000  # maximum number of names compared with a wrong name
_MOST_ELEMENTS = 4  # arrays with more elements are not shown in full

_repr = reprlib.Repr()
_repr.maxstring = _repr.maxlong = _repr.maxother = _LONGEST


def short(value: object) -> str:
    """Format a value as one line of at most 80 characters; long arrays as shape and dtype."""
    shape, dtype = getattr(value, "shape", None), getattr(value, "dtype", None)
    if dtype is not None and isinstance(shape, tuple) and math.prod(shape) > _MOST_ELEMENTS:
        return f"an array of shape {shape} and type {dtype}"
    text = " ".join(_repr.repr(value).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def hint(wrong: object, known: Iterable[str], most: int = 1) -> str:
    """Return `; did you mean a or b?` with up to `most` similar names, or "" without any."""
    # A ROS message may contain any number of names, so only the first ones are compared.
    close = difflib.get_close_matches(str(wrong)[:_LONGEST], islice(known, _MOST_NAMES), most)
    return f"; did you mean {' or '.join(close)}?" if close else ""


def wrong_crs(crs: object) -> ConfigError:
    expected = "WKT, a code such as 'EPSG:25832', or a string of PROJ"
    return ConfigError(f"crs: expected {expected}, got {short(crs)}")


def required(module: str, feature: str, remedy: str = "") -> Any:
    """Import a module, or raise a `MissingPackageError` that says how to install it."""
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise MissingPackageError(package, feature, remedy or remedy_for(module)) from error


def cut(text: str) -> str:
    """Replace the middle of a text with ` ... ` if the text exceeds 500 characters."""
    if len(text) <= _LONGEST_TEXT:
        return text
    return f"{text[: _LONGEST_TEXT - _END - 5]} ... {text[-_END:]}"
