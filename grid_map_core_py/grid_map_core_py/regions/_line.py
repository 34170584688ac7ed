# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Cells along a straight line."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays._checks import Cells, Mask, Positions, Size, as_pair, as_size, as_text
from ..errors import OutOfMapError
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..map._ring_buffer import place
from ._shapes import empty_cells


def line_cells(grid_map: GridMap, start: ArrayLike, end: ArrayLike) -> Cells:
    """Return the cells (rows, cols) along a line, from its start to its end.

    The line is clipped to the map. It is drawn after Bresenham between the cells of its two ends,
    both included: neighboring cells share a side or a corner.

    Args:
        start, end: (2,) ends of the line [m]; they may be outside the map.

    Raises:
        OutOfMapError: the line does not touch the map.
        GeometryError: a number is not finite.
    """
    ends = np.array([as_pair(start, "start"), as_pair(end, "end")])
    cells, on_map = grid_map.geometry.cells_at(ends)
    if not on_map.all():
        cells = _clipped(grid_map.geometry, ends, on_map)
    (first_row, last_row), (first_column, last_column) = (numbers.tolist() for numbers in cells)
    return _drawn(grid_map, (first_row, first_column), (last_row, last_column))


def line_cells_between(grid_map: GridMap, start_index: ArrayLike, end_index: ArrayLike) -> Cells:
    """Return the cells (rows, cols) along the line between two cells.

    Both ends are included. See `line_cells`.

    Args:
        start_index, end_index: buffer indices of the ends.

    Raises:
        OutOfMapError: there is no such cell.
    """
    ends = as_size(start_index, "start_index"), as_size(end_index, "end_index")
    grid_map.geometry.check_cells(np.array(ends))
    (row, column), (rows, columns) = grid_map.start_index, grid_map.size
    first, last = (((i - row) % rows, (j - column) % columns) for i, j in ends)
    return _drawn(grid_map, first, last)


def _drawn(grid_map: GridMap, first: Size, last: Size) -> Cells:
    """Return the buffer cells of Bresenham's line between two cells of the map.

    The axis with more steps takes one per cell. After k of n cells, the other axis has taken
    (n // 2 + k * steps) // n of its steps: the error term of the usual loop in closed form.
    """
    steps = [last[axis] - first[axis] for axis in (0, 1)]
    longer = max(abs(steps[0]), abs(steps[1]))
    along = np.arange(longer + 1)
    cells = empty_cells(along.size)
    for axis, numbers in enumerate(cells):
        taken = (longer // 2 + along * abs(steps[axis])) // max(longer, 1)
        numbers[:] = taken if steps[axis] > 0 else -taken
        place(numbers, first[axis], grid_map.start_index[axis], grid_map.size[axis])
    return cells


def _clipped(geometry: GridGeometry, ends: Positions, on_map: Mask) -> Cells:
    """Return the first and the last cell of a line clipped to the map.

    Liang and Barsky: every border of the map cuts off the line before or behind a fraction of it.

    Raises:
        OutOfMapError: there is no such part.
    """
    enters, leaves = 0.0, 1.0
    lower = (geometry.position - 0.5 * geometry.length).tolist()
    upper = geometry.corner.tolist()
    for a, b, low, high in zip(*ends.tolist(), lower, upper, strict=True):
        # The difference of two large numbers could overflow; the difference of their halves cannot.
        extent = 0.5 * b - 0.5 * a
        if extent:
            cuts = sorted((0.5 * border - 0.5 * a) / extent for border in (low, high))
            enters, leaves = max(enters, cuts[0]), min(leaves, cuts[1])
        elif not (low <= a <= high or on_map.any()):
            enters, leaves = 1.0, 0.0
    # Rounding may put an end that is on the border outside.
    if on_map[0]:
        enters, leaves = 0.0, max(leaves, 0.0)
    elif on_map[1]:
        enters, leaves = min(enters, 1.0), 1.0
    if enters <= leaves:
        fractions = np.array([[enters], [leaves], [0.5 * (enters + leaves)]])
        cells, found = geometry.cells_at((1.0 - fractions) * ends[0] + fractions * ends[1])
        # The borders at -x and -y are outside, and so is the middle of a line along them.
        if found.any():
            return cells[0][:2], cells[1][:2]
    start, end = map(as_text, ends)
    raise OutOfMapError(f"the line from {start} to {end} does not touch the map: {geometry.place}")
