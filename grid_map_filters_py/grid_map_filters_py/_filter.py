# SPDX-License-Identifier: BSD-3-Clause
"""Filter protocols and filter warnings."""

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
    from grid_map_core_py.tiled import TiledMap
    from grid_map_core_py.tiled._source import Window

WHOLE_MAP = math.inf
"""Reach of a filter whose result may depend on all cells, or that has no `reach` method."""


class Filter(Protocol):
    """Callable that filters a map and returns the result.

    Filters that can be used in YAML are frozen dataclasses whose fields are the YAML parameters.
    `grid_map_core_py.plugins.build` checks the names and types of the parameters, and
    `__post_init__` checks the values. A filter that fails raises an error. If a result needs the
    user's attention, the filter calls `warn`. Other protocols, such as `LocalFilter`, describe
    optional methods.
    """

    def __call__(self, grid_map: GridMap) -> GridMap:
        """Return the filtered map, which shares unchanged layers with the input.

        Args:
            grid_map: map with start index (0, 0); a filter must not modify its layers in place.
        """


@runtime_checkable
class LocalFilter(Filter, Protocol):
    """Filter whose output cells depend only on nearby input cells."""

    def reach(self, resolution: float) -> float:
        """Return the reach of the filter [cells], or `WHOLE_MAP`.

        A cell of the output depends only on input cells that are at most this number of rows and
        columns away. `resolution` is the cell size [m].
        """


@runtime_checkable
class GlobalFilter(Filter, Protocol):
    """Filter that needs statistics of the whole map, such as a mean, before it runs on tiles."""

    def for_tiles_of(self, tiled_map: "TiledMap", options: "TileOptions", /) -> Filter:
        """Compute the statistics with `tiled_map.over_tiles`; return a `LocalFilter` for tiles."""


@runtime_checkable
class PartlyLocalFilter(Filter, Protocol):
    """Filter that runs on tiles only with certain parameters."""

    def why_whole_map(self, names: Container[str], /) -> str:
        """Return why a map with the layers `names` cannot be filtered in tiles; "" if it can."""


@runtime_checkable
class WideningFilter(LocalFilter, Protocol):
    """Filter whose reach depends on the data; `reach` returns the initial reach."""

    def missing(self, tile: GridMap, window: "Window", /) -> int:
        """Return the number of cells by which to widen a tile; 0 if the tile is large enough."""


class CellFilter:
    """Base class for filters that compute each cell from the same cell of the input."""

    def reach(self, _resolution: float) -> float:
        """Return 0: other cells have no influence."""
        return 0


def reach_of(function: Filter, resolution: float) -> float:
    """Return the checked reach of a filter: a whole number of cells, or `WHOLE_MAP`."""
    cells = function.reach(resolution) if isinstance(function, LocalFilter) else WHOLE_MAP
    is_number = isinstance(cells, int | float | np.integer | np.floating)
    if not (is_number and cells >= 0 and (cells == WHOLE_MAP or float(cells).is_integer())):
        raise FilterError(f"reach: expected a number of cells or WHOLE_MAP, got {short(cells)}")
    return float(cells)


@dataclass(frozen=True, kw_only=True)
class TileOptions:
    """Options for filters on tiled maps; see `FilterChain.on_tiles`."""

    max_hole: int
    large_holes: Literal["refuse", "leave"] = "refuse"

    def __post_init__(self) -> None:
        check(self.max_hole >= 1, "max_hole", "a number of cells", self.max_hole)
        known = self.large_holes in ("refuse", "leave")
        check(known, "large_holes", "'refuse' or 'leave'", self.large_holes)


class FilterWarning(UserWarning):
    """Warning about a filter result."""


_running: ContextVar[tuple[str, list[str] | None]] = ContextVar("_running", default=("", None))
"""Name of the step that this thread runs, and the list that collects its warnings."""


@contextmanager
def running(step: object, collected: list[str] | None) -> Iterator[None]:
    """Context in which `warn` prefixes messages with `step` and appends them to `collected`."""
    token = _running.set((f"{step}: ", collected))
    try:
        yield
    finally:
        _running.reset(token)


def warn(message: str) -> None:
    """Warn the user about a filter result.

    In a chain, the name of the filter is added to the message. If the chain was called with a list
    `warnings`, the message is appended to this list. Otherwise, the message is issued as a Python
    warning of the class `FilterWarning`.
    """
    step, collected = _running.get()
    pass_on([step + message], collected, stacklevel=3)


def pass_on(texts: Iterable[str], collected: list[str] | None, stacklevel: int = 2) -> None:
    """Append warnings to `collected`, or issue them as `FilterWarning` if `collected` is None."""
    if collected is not None:
        collected.extend(texts)
        return
    for text in texts:
        warnings.warn(text, FilterWarning, stacklevel=stacklevel)


C = TypeVar("C", bound=Callable[..., GridMap])

_kept = [0]
"""Largest block that `in_map_order` has allocated and freed [bytes]."""


def check_map(grid_map: object) -> None:
    if not isinstance(grid_map, GridMap):
        remedy = "dataset.grid_map.filter(chain) and tiled_map.filter(chain) filter other maps"
        found = type(grid_map).__name__
        raise FilterError(f"grid_map: expected a GridMap, got {found}. {remedy}")


def in_map_order(call: C) -> C:
    """Decorator for the `__call__` of filters that need maps in map order, with start index (0, 0).

    A map with another start index is reordered for the filter, and the result gets the original
    start index. In a chain, maps are already in map order.
    """

    @functools.wraps(call)
    def wrapped(self: object, grid_map: GridMap) -> GridMap:
        check_map(grid_map)
        # After a large block is freed, glibc retains up to twice its size for later arrays. The
        # block has 64 bytes per cell, at most 32 MB. Without it, the system would zero the pages of
        # all temporary arrays, which takes half the run time on a 400 x 400 map.
        block = min(64 * math.prod(grid_map.size), 2**25 - 2**16)
        if block > _kept[0]:
            _kept[0] = block
            np.empty(block, np.uint8)
        start = grid_map.start_index
        if start == (0, 0):
            return call(self, grid_map)
        return call(self, grid_map.with_start_index((0, 0))).with_start_index(start)

    return cast(C, wrapped)
