# SPDX-License-Identifier: BSD-3-Clause
"""Runs filter chains on many maps from bags, folders or generators, without a node."""

from collections.abc import Callable, Iterable, Iterator, Sized
from dataclasses import dataclass
from traceback import clear_frames
from typing import Any, Generic, TypeVar

from grid_map_core_py import GridMap

from ._chain import FilterChain
from ._step import StepObserver, message_of
from .errors import FilterError

T = TypeVar("T")


@dataclass(frozen=True)
class Filtered(Generic[T]):
    """A filtered map and the input item; `index` counts from 0."""

    index: int
    item: T
    grid_map: GridMap


@dataclass(frozen=True)
class Failure:
    """A map that could not be loaded or filtered; `index` counts from 0."""

    index: int
    message: str

    def __str__(self) -> str:
        return f"map {self.index}: {self.message}"


def filter_maps(
    chain: FilterChain,
    items: Iterable[T],
    *,
    load: Callable[[T], GridMap] | None = None,
    failures: list[Failure] | None = None,
    observer: StepObserver | None = None,
    progress: Callable[[int, int | None], Any] | None = None,
) -> Iterator[Filtered[T]]:
    """Yield the filtered maps one after the other, computed on demand.

    Only one map is in memory at a time.

    Args:
        chain: filters for every map.
        items: maps, or items that `load` converts to maps.
        load: function that returns the map of an item. An error counts as a failure of that map.
        failures: list to which failures are appended; the remaining maps are still yielded. If
            None, the first failure raises an error.
        observer: called after every step of every map.
        progress: called after every map, even if it failed. The arguments are the number of
            finished maps and the total number of maps, which is None if `items` has no length.

    Raises:
        FilterError: a map could not be loaded or filtered; the message contains the index of the
            map. Errors raised by `items` itself are not caught.

    Example:
        >>> chain = FilterChain.from_config([{
        ...     "name": "twice", "type": "gridMapFilters/MathExpressionFilter",
        ...     "params": {"expression": "2 * height", "output_layer": "height"}}])
        >>> maps = (GridMap((1, 1), 0.5, layers={"height": height}) for height in range(3))
        >>> [float(filtered.grid_map["height"].max()) for filtered in filter_maps(chain, maps)]
        [0.0, 2.0, 4.0]
    """
    total = len(items) if isinstance(items, Sized) else None
    index = -1
    for item in items:
        # `enumerate` would keep an item in memory until the next item is read.
        index += 1  # noqa: SIM113
        grid_map = result = None
        try:
            grid_map = load(item) if load else item
            if not isinstance(grid_map, GridMap):
                raise FilterError(f"expected a GridMap, got {type(grid_map).__name__}")
            result = chain(grid_map, observer)
        except Exception as error:
            failure = Failure(index, message_of(error))
            if failures is None:
                raise FilterError(str(failure)) from error
            failures.append(failure)
            # In Python 3.12, a frame of contextlib would keep the map until the next collection.
            clear_frames(error.__traceback__)
        if progress is not None:
            progress(index + 1, total)
        if result is not None:
            yield Filtered(index, item, result)
        del item, grid_map, result
