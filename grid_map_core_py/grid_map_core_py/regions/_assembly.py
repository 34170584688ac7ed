# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How the cell shapes are put together.

Rows and columns are built separately, each contiguous, because layers are indexed by them so.
"""

import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from ..arrays._checks import Cells, Mask, Positions, as_number
from ..errors import GeometryError
from ..map._geometry import BORDER_TOLERANCE

if TYPE_CHECKING:
    from ..map._grid_map import GridMap

Integers: TypeAlias = npt.NDArray[np.int64]
"""(N,) rows or columns."""

_BAND = 2**13
"""Cells."""


def cells_inside(
    grid_map: "GridMap",
    lower: Positions,
    upper: Positions,
    contains: Callable[[Positions, Positions], Mask],
) -> Cells:
    """Return the (N, 2) buffer indices of the cells whose centre a shape contains, row by row.

    Args:
        lower, upper: (2,) a box around the shape [m].
        contains: takes the centres of a block of cells as x (rows, 1) and y (cols,) [m], both
            descending, and returns (rows, cols) bool.
    """
    rows, columns = grid_map.geometry.box(lower, upper)
    x, y = grid_map.geometry.axes()
    x, y = x[rows], y[columns]
    mask = np.empty((x.size, y.size), dtype=bool)
    for band in _bands(mask):
        mask[band] = contains(x[band, None], y)
    return cells_of_mask(grid_map, rows, columns, mask)


def cells_of_mask(grid_map: "GridMap", rows: slice, columns: slice, mask: Mask) -> Cells:
    """Return the (N, 2) buffer indices of the cells of a block where `mask` is true, row by row."""
    cells = empty_cells(int(np.count_nonzero(mask)))
    block_rows, block_columns = cells.T
    width, done = mask.shape[1], 0
    for band in _bands(mask):
        (found,) = mask[band].ravel().nonzero()
        row, column = (numbers[done : done + found.size] for numbers in (block_rows, block_columns))
        # NumPy divides faster without signs, and multiplies faster than it takes remainders.
        np.floor_divide(found.view(np.uint64), np.uint64(width), out=row.view(np.uint64))
        np.multiply(row, -width, out=column)
        column += found
        place(row, rows.start + band.start, grid_map.start_index[0], grid_map.size[0])
        place(column, columns.start, grid_map.start_index[1], grid_map.size[1])
        done += found.size
    return cells


def cells_of_runs(grid_map: "GridMap", first_row: int, start: Integers, stop: Integers) -> Cells:
    """Return the (N, 2) buffer indices of one run of cells per row, row by row.

    Args:
        first_row: row of the map of the first run; the others are in the rows that follow.
        start, stop: (rows,) columns of the map from which and up to which (exclusive) the runs go.
            A run that stops before it starts is empty.
    """
    counts = np.maximum(stop - start, 0)
    ends = counts.cumsum()
    cells = empty_cells(int(counts.sum()))
    rows = np.arange(counts.size)
    place(rows, first_row, grid_map.start_index[0], grid_map.size[0])
    cells[:, 0] = rows.repeat(counts)
    cells[:, 1] = np.arange(len(cells))
    cells[:, 1] += (start - ends + counts).repeat(counts)
    place(cells[:, 1], 0, grid_map.start_index[1], grid_map.size[1])
    return cells


def _bands(mask: Mask) -> Iterator[slice]:
    """Yield rows that are looked at together, so that what is computed fits into the cache."""
    step = max(_BAND // max(mask.shape[1], 1), 1)
    for first in range(0, mask.shape[0], step):
        yield slice(first, first + step)


def empty_cells(count: int) -> Cells:
    """Return (count, 2) integers to be filled; the rows and the columns are contiguous."""
    return np.empty((2, count), dtype=np.int64).T


def place(numbers: Integers, first: int, start: int, size: int) -> None:
    """Turn rows or columns of a block of the map into those of the buffer, in place.

    Args:
        numbers: (N,) counted from `first`; the cells lie on the map.
        first: row or column of the map where the block begins.
        start, size: start index and number of cells of the map along this axis.
    """
    numbers += first + start
    if start:
        close_ring(numbers, size)


def close_ring(numbers: Integers, size: int) -> None:
    """Bring (N,) rows or columns beyond the end of the buffer back to its beginning, in place."""
    # Of a number and the same less a turn, one is on the map; negative ones are huge unsigned.
    unsigned = numbers.view(np.uint64)
    np.minimum(unsigned, (numbers - size).view(np.uint64), out=unsigned)


def checked_radius(radius: float) -> float:
    """Return a radius [m] as a float that reaches as far as its rim counts.

    Raises:
        GeometryError: it is negative or not finite.
    """
    number = as_number(radius, "radius")
    if not (math.isfinite(number) and number >= 0):
        raise GeometryError(f"radius: expected a finite number >= 0, got {radius!r}")
    return number + BORDER_TOLERANCE
