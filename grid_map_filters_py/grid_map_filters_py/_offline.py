# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A chain over many maps without a node: a recording, a folder of files, a generator.

Where the maps come from is up to the caller: `filter_maps` takes any iterable, and a function that
makes a map of what it yields. A reader of recordings plugs in there: it yields its records without
decoding them, `load` decodes one, and the results come back beside the records they belong to.
"""

from collections.abc import Callable, Iterable, Iterator, Sized
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from grid_map_core_py import GridMap

from ._chain import FilterChain, StepObserver, message_of
from .errors import FilterError

T = TypeVar("T")

Progress = Callable[[int, int | None], Any]
"""Is told how many maps are through, failed ones included, and how many there are, if known."""


@dataclass(frozen=True)
class Filtered(Generic[T]):
    """A filtered map and what it was made of; `index` counts from 0."""

    index: int
    item: T
    grid_map: GridMap


@dataclass(frozen=True)
class Failure:
    """A map that could not be loaded or filtered; `index` counts from 0.

    It holds a text instead of the exception, which would keep the map in memory.
    """

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
    progress: Progress | None = None,
) -> Iterator[Filtered[T]]:
    """Yield the filtered maps one after the other, each made when it is asked for.

    Nothing is kept of a map once the next one is asked for.

    Args:
        chain: filters that every map goes through.
        items: maps, or what `load` makes maps of.
        load: returns the map of an item; what it raises is an error of that map alone.
        failures: maps that fail are appended here and left out; None raises at the first.
        observer: is told of every step of every map; a `StepTimes` collects how long they take.
        progress: is called after every map; a `ProgressBar` shows it. The number of maps is known
            where `items` has a length.

    Raises:
        FilterError: a map could not be loaded or filtered; the message names its index. What
            iterating over `items` raises passes through.

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
        # `enumerate` would hold on to an item until it has the next one.
        index += 1  # noqa: SIM113
        result = None
        try:
            result = chain(_load(item, load), observer)
        except Exception as error:
            failure = Failure(index, message_of(error))
            if failures is None:
                raise FilterError(str(failure)) from error
            failures.append(failure)
        if progress is not None:
            progress(index + 1, total)
        if result is not None:
            yield Filtered(index, item, result)
        del item, result


def _load(item: T, load: Callable[[T], GridMap] | None) -> GridMap:
    grid_map = load(item) if load else item
    if not isinstance(grid_map, GridMap):
        raise FilterError(f"expected a GridMap, found {type(grid_map).__name__}")
    return grid_map
