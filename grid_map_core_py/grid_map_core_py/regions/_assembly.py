# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Parts that the cell shapes share."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..arrays._checks import Cells, Integers, Mask, Positions, as_number
from ..errors import GeometryError
from ..map._geometry import BORDER_TOLERANCE
from ..map._ring_buffer import place

if TYPE_CHECKING:
    from ..map._grid_map import GridMap

_BAND = 2**13
"""Number of cells in a band, whose temporaries fit into the cache."""


def cells_inside(
    grid_map: GridMap,
    lower: Positions,
    upper: Positions,
    contains: Callable[[Positions, Positions], Mask],
) -> Cells:
    """Return the cells (rows, cols) whose center a shape contains, row after row.

    Args:
        lower, upper: (2,) a box around the shape [m].
        contains: takes the centers of a block of cells as x (rows, 1) and y (cols,) [m], both
            descending, and returns (rows, cols) bool.
    """
    rows, columns = grid_map.geometry.box(lower, upper)
    x, y = grid_map.geometry.axes_in_map_order()
    x, y = x[rows], y[columns]
    mask = np.empty((x.size, y.size), dtype=bool)
    for band in _bands(mask):
        mask[band] = contains(x[band, None], y)
    return cells_of_mask(grid_map, rows, columns, mask)


def cells_of_mask(grid_map: GridMap, rows: slice, columns: slice, mask: Mask) -> Cells:
    """Return the cells (rows, cols) of a block where `mask` is true, row after row."""
    cells = empty_cells(int(np.count_nonzero(mask)))
    width, done = mask.shape[1], 0
    for band in _bands(mask):
        (found,) = mask[band].ravel().nonzero()
        row, column = (numbers[done : done + found.size] for numbers in cells)
        # NumPy divides unsigned integers faster, and multiplication is faster than `%`.
        np.floor_divide(found.view(np.uint64), np.uint64(width), out=row.view(np.uint64))
        np.multiply(row, -width, out=column)
        column += found
        place(row, rows.start + band.start, grid_map.start_index[0], grid_map.size[0])
        place(column, columns.start, grid_map.start_index[1], grid_map.size[1])
        done += found.size
    return cells


def cells_of_runs(grid_map: GridMap, first_row: int, start: Integers, stop: Integers) -> Cells:
    """Return the cells (rows, cols) of one run per row, row after row.

    Args:
        first_row: row of the map of the first run; the others are in the rows that follow.
        start, stop: (rows,) columns of the map from which and up to which (exclusive) the runs go.
            A run that stops before it starts is empty.
    """
    counts = np.maximum(stop - start, 0)
    ends = counts.cumsum()
    lines = np.arange(counts.size)
    place(lines, first_row, grid_map.start_index[0], grid_map.size[0])
    columns = np.arange(int(counts.sum()))
    columns += (start - ends + counts).repeat(counts)
    place(columns, 0, grid_map.start_index[1], grid_map.size[1])
    return lines.repeat(counts), columns


def _bands(mask: Mask) -> Iterator[slice]:
    """Yield slices of rows whose cells fit into the cache."""
    step = max(_BAND // max(mask.shape[1], 1), 1)
    for first in range(0, mask.shape[0], step):
        yield slice(first, first + step)


def empty_cells(count: int) -> Cells:
    """Return uninitialized `count` rows and columns."""
    rows, columns = np.empty((2, count), dtype=np.int64)
    return rows, columns


def checked_radius(radius: float) -> float:
    """Return a checked radius [m], enlarged by the tolerance of the closed rim.

    Raises:
        GeometryError: it is negative or not finite.
    """
    number = as_number(radius, "radius")
    if not (math.isfinite(number) and number >= 0):
        raise GeometryError(f"radius: expected a finite number >= 0, got {radius!r}")
    return number + BORDER_TOLERANCE
