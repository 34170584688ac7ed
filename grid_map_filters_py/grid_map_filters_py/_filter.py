# SPDX-License-Identifier: BSD-3-Clause
"""The filter protocol, and warnings of filters.

A filter is a frozen dataclass that can be called. Its fields are its YAML parameters:
`FilterChain` checks their names and types, `__post_init__` their values. A call
takes a map whose start index is (0, 0), and returns a new map that shares the unchanged layers. It
never writes into its input. A filter raises an error if it cannot do its work, and calls `warn` if
the user should know something about the result.

A filter may say how far it looks, by a method `reach(resolution)`: a cell of its output depends on
the cells of its input that are at most this number of rows and columns away. Other filters look at
the whole map.

On tiled maps, further methods are possible. `for_tiles_of(site, options)` returns another filter,
with the quantities of the whole map put in that it needs; `site` is the `TiledMap` before it, whose
`over_tiles` reduces. That filter has a `reach`, and if this depends on the data, a method
`missing(grid_map, window)`: the number of cells by which the border around a window of `grid_map`
is too narrow. `why_whole_map(names)` explains why a map with these layers cannot be tiled; its text
is empty if it can.
"""

import functools
import math
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, TypeVar, cast

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.errors import short
from grid_map_core_py.plugins import check

from ._memory import keep_temporaries
from .errors import FilterError

if TYPE_CHECKING:
    from grid_map_core_py.tiled import TiledMap


class Filter(Protocol):
    """Callable from map to map; filters with a type name in YAML are dataclasses."""

    def __call__(self, grid_map: GridMap) -> GridMap:
        """Return the filtered map; the input stays unchanged."""


WHOLE_MAP = math.inf
"""Reach of a filter that may look at all cells; the reach of filters that declare none."""


class CellFilter:
    """Base class of filters whose cells depend on the same cell of the input alone."""

    def reach(self, _resolution: float) -> float:
        """Return 0: the filter looks at no other cells."""
        return 0


def reach_of(function: Filter, resolution: float) -> float:
    """Return how far a filter looks: a whole number of cells, or `WHOLE_MAP`.

    Args:
        function: any filter.
        resolution: side of a cell [m].

    Raises:
        FilterError: the filter gives neither.
    """
    reach = getattr(function, "reach", None)
    # A filter may have a parameter of this name.
    cells = reach(resolution) if callable(reach) else WHOLE_MAP
    is_number = isinstance(cells, int | float | np.integer | np.floating)
    if not (is_number and cells >= 0 and (cells == WHOLE_MAP or float(cells).is_integer())):
        raise FilterError(f"reach: expected a number of cells or WHOLE_MAP, got {short(cells)}")
    return float(cells)


@dataclass(frozen=True, kw_only=True)
class TileOptions:
    """Choices of the user for filters on tiled maps; see `FilterChain.on_tiles`."""

    max_hole: int
    large_holes: Literal["refuse", "leave"] = "refuse"

    def __post_init__(self) -> None:
        check(self.max_hole >= 1, "max_hole", "a number of cells", self.max_hole)
        known = self.large_holes in ("refuse", "leave")
        check(known, "large_holes", "'refuse' or 'leave'", self.large_holes)


def for_tiles_of(function: Filter, site: "TiledMap", options: TileOptions) -> Filter:
    """Return the filter for the tiles of a map, with the quantities of the whole map put in.

    Args:
        function: a filter; its method of the same name, if any, does it.
        site: the map before the filter.
        options: choices of the user.
    """
    bind = getattr(function, "for_tiles_of", None)
    bound: Filter = bind(site, options) if callable(bind) else function
    return bound


class FilterWarning(UserWarning):
    """Warning about the result of a filter."""


_running: ContextVar[tuple[str, list[str] | None]] = ContextVar("_running", default=("", None))
"""Name of the step that this thread runs, and the list that collects its warnings."""


@contextmanager
def running(step: object, collected: list[str] | None) -> Iterator[None]:
    """Make `warn` name a step of a chain, and append to `collected` unless it is None."""
    token = _running.set((f"{step}: ", collected))
    try:
        yield
    finally:
        _running.reset(token)


def warn(message: str) -> None:
    """Warn the user about the result of a filter.

    In a chain, the message names the filter and is appended to the list that the caller of the
    chain passed as `warnings`. Without a list or a chain, it becomes a Python warning of the class
    `FilterWarning`.
    """
    step, collected = _running.get()
    pass_on([step + message], collected, stacklevel=3)


def pass_on(texts: Iterable[str], collected: list[str] | None, stacklevel: int = 2) -> None:
    """Append warnings to a list; without one, issue them."""
    if collected is not None:
        collected.extend(texts)
        return
    for text in texts:
        warnings.warn(text, FilterWarning, stacklevel=stacklevel)


C = TypeVar("C", bound=Callable[..., GridMap])


def in_map_order(call: C) -> C:
    """Decorator for `__call__` of a filter that needs maps in map order.

    A map that has moved is unwrapped, and the result is stored from its start index again. Filters
    that use neighboring cells need it outside of chains; a chain does the same. Memory that the
    filter frees is kept for the next one.
    """

    @functools.wraps(call)
    def wrapped(self: object, grid_map: GridMap) -> GridMap:
        keep_temporaries(grid_map.size)
        start = grid_map.start_index
        if start == (0, 0):
            return call(self, grid_map)
        return call(self, grid_map.with_start_index((0, 0))).with_start_index(start)

    return cast(C, wrapped)
