# SPDX-License-Identifier: BSD-3-Clause
"""Protocols of filters, and warnings of filters."""

import functools
import math
import warnings
from collections.abc import Callable, Container, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol, TypeVar, cast, runtime_checkable

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.errors import short
from grid_map_core_py.plugins import check

from .errors import FilterError

if TYPE_CHECKING:
    from grid_map_core_py.tiled import (
        TiledMap,
    )
    from grid_map_core_py.tiled._source import Window

WHOLE_MAP = math.inf
"""Reach of filters that may look at all cells, and of filters without a `reach`."""


class Filter(Protocol):
    """Callable from map to map.

    Filters with a type name in YAML are frozen dataclasses. Their fields are the YAML parameters:
    `grid_map_core_py.plugins.build` checks names and types, `__post_init__` the values. A filter
    raises an error if it fails, and calls `warn` about results that need the user's attention. The
    protocols below describe optional methods.
    """

    def __call__(self, grid_map: GridMap) -> GridMap:
        """Return the filtered map, which shares unchanged layers with the input.

        Args:
            grid_map: its start index is (0, 0), and its layers must stay unchanged.
        """


@runtime_checkable
class LocalFilter(Filter, Protocol):
    """Filter that declares how far it looks; others look at the whole map."""

    def reach(self, resolution: float) -> float:
        """Return a number of cells, or `WHOLE_MAP`.

        A cell of the output depends on the cells of the input that are at most this number of rows
        and columns away.

        Args:
            resolution: side of a cell [m].
        """


@runtime_checkable
class GlobalFilter(Filter, Protocol):
    """Filter that needs quantities of the whole map, such as a mean, but is local otherwise."""

    def for_tiles_of(self, tiled_map: "TiledMap", options: "TileOptions", /) -> Filter:
        """Compute the quantities, and return a `LocalFilter` for the tiles.

        Args:
            tiled_map: the input map; its `over_tiles` helps to compute the quantities.
            options: choices of the user.
        """


@runtime_checkable
class PartlyLocalFilter(Filter, Protocol):
    """Filter that runs on tiles with certain parameters only."""

    def why_whole_map(self, names: Container[str], /) -> str:
        """Return why a map with these layers cannot be tiled; empty if it can."""


@runtime_checkable
class WideningFilter(LocalFilter, Protocol):
    """Filter whose reach depends on the data; `reach` is the initial value."""

    def missing(self, tile: GridMap, window: "Window", /) -> int:
        """Return the number of cells by which the border of a tile is too narrow."""


class CellFilter:
    """Base class of filters that compute each cell from the same cell of the input."""

    def reach(self, _resolution: float) -> float:
        """Return 0."""
        return 0


def reach_of(function: Filter, resolution: float) -> float:
    """Return how far a filter looks: a whole number of cells, or `WHOLE_MAP`.

    Raises:
        FilterError: `reach` returned anything else.
    """
    cells = function.reach(resolution) if isinstance(function, LocalFilter) else WHOLE_MAP
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

_kept = [0]
"""Largest block that `in_map_order` has freed [bytes]."""


def in_map_order(call: C) -> C:
    """Decorate `__call__` of a filter that needs maps in map order.

    A moved map is unwrapped, and its start index is restored in the result. Filters that look at
    neighboring cells need the decorator outside of chains; a chain does the same. Memory that the
    filter frees is kept for the next one.
    """

    @functools.wraps(call)
    def wrapped(self: object, grid_map: GridMap) -> GridMap:
        # glibc keeps twice the largest block that was freed, here 64 bytes per cell and at most
        # 64 MB; otherwise the system clears the pages of all temporaries, which takes half of the
        # time of a chain on 400 x 400 cells.
        block = min(64 * math.prod(grid_map.size), 2**25 - 2**16)
        if block > _kept[0]:
            _kept[0] = block
            np.empty(block, np.uint8)
        start = grid_map.start_index
        if start == (0, 0):
            return call(self, grid_map)
        return call(self, grid_map.with_start_index((0, 0))).with_start_index(start)

    return cast(C, wrapped)
