# SPDX-License-Identifier: BSD-3-Clause
"""Points sorted by cell, so that no result depends on the order in which they came."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers
from .._loops import loop
from ._sensors import Numbers


@dataclass(frozen=True)
class Sorted:
    """Points sorted by cell; within a cell from the highest down, equal ones by variance.

    Attributes:
        order: (n,) places of the points before.
        heights, variances: (n,) of the points.
        cells: (m,) cells that have points, ascending.
        begins, ends: (m,) the first point of each cell, and the one behind its last.
    """

    order: Integers
    heights: Numbers
    variances: Numbers
    cells: Integers
    begins: Integers
    ends: Integers

    @property
    def groups(self) -> Integers:
        """(n,) the place in `cells` of each point."""
        return np.repeat(np.arange(len(self.cells)), self.ends - self.begins)


def sorted_by_cell(cells: Integers, heights: Numbers, variances: Numbers, size: int) -> Sorted:
    """Sort points (n,) by cell; `size` is the number of cells."""
    if compiled := deal.compiled():
        count = len(cells)
        order, dealt = np.empty(count, np.int64), np.empty((2, count))
        borders = np.zeros(size + 1, np.int64)
        heights, variances = np.ascontiguousarray(heights), np.ascontiguousarray(variances)
        compiled(cells, (heights, variances), count, size, borders, order, (*dealt,))
        begins, ends = np.concatenate(([0], borders[: size - 1])), borders[:size]
        occupied = np.flatnonzero(ends > begins)
        return Sorted(order, dealt[0], dealt[1], occupied, begins[occupied], ends[occupied])
    order = np.lexsort((variances, -heights, cells))
    cells = cells[order]
    begins = np.flatnonzero(np.diff(cells, prepend=-1))
    ends = np.append(begins[1:], len(cells))
    return Sorted(order, heights[order], variances[order], cells[begins], begins, ends)


def in_one_order(points: Sorted, values: NDArray[Any]) -> Integers:
    """Return the order of points, in which values (n,) decide between equal points."""
    order = points.order
    same = np.zeros(len(order) + 1, np.bool_)
    same[1:-1] = (np.diff(points.heights) == 0) & (np.diff(points.variances) == 0)
    same[points.begins] = False
    tied = np.flatnonzero(same[1:] | same[:-1])
    if not len(tied):
        return order
    runs = np.cumsum(~same[:-1])[tied]
    order = order.copy()
    order[tied] = order[tied[np.lexsort((values[order[tied]], runs))]]
    return order


@loop("int64*", ("float64*", 2), "int64", "int64", "int64*", "int64*", ("float64*", 2))
def deal(
    cells: Any, points: Any, count: Any, size: Any, borders: Any, order: Any, dealt: Any
) -> None:
    """Deal points to their cells, and sort them there; `borders` (size + 1) are the ends then.

    Args:
        cells: (count,) cells of the points.
        points: (count,) their heights and variances.
        size: number of cells.
        borders, order, dealt: results; `dealt` are the sorted heights and variances.
    """
    heights, variances = points
    sorted_heights, sorted_variances = dealt
    for i in range(count):
        borders[cells[i] + 1] += 1
    for cell in range(size):
        borders[cell + 1] += borders[cell]
    for i in range(count):
        place = borders[cells[i]]
        borders[cells[i]] = place + 1
        order[place] = i
        sorted_heights[place] = heights[i]
    begin = 0
    for cell in range(size):
        sort_part(begin, borders[cell], order, sorted_heights, variances)
        begin = borders[cell]
    for i in range(count):
        sorted_variances[i] = variances[order[i]]


def sort_part(begin: Any, end: Any, order: Any, heights: Any, variances: Any) -> None:
    """Sort some points from the highest down, equal ones by variance (Shell's method).

    Args:
        begin, end: the places of the points.
        order, heights: numbers and heights of the points, by place.
        variances: variances of the points, by number.
    """
    gap = (end - begin) // 2 if end - begin > 12 else 1
    while gap > 0:
        for i in range(begin + gap, end):
            height, number = heights[i], order[i]
            place = i
            while place - gap >= begin and not heights[place - gap] > height:
                before = order[place - gap]
                if heights[place - gap] == height and variances[before] <= variances[number]:
                    break
                heights[place], order[place] = heights[place - gap], before
                place -= gap
            heights[place], order[place] = height, number
        # Gaps of Gonnet and Baeza-Yates: 5 / 11 of the last one, and 1 at the end.
        gap = 1 if gap == 2 else (gap * 5 - 1) // 11
