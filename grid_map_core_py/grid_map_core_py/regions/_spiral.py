# SPDX-License-Identifier: BSD-3-Clause
"""Cells of a disc in spiral order, from the inside out."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Cells, Integers, Pair, Positions, Size, as_pair
from ..map._axis import BORDER_TOLERANCE
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..map._ring_buffer import place
from ._shapes import checked_radius, circle_cells, empty_cells

# Number of rings in the cached spiral (0.8 MB), from which smaller spirals are cut without sorting.
KEPT_RINGS = 128

# Disc centers outside the map are limited to this row and column, whose squares fit into int64.
FAR = 2.0**30


def spiral_cells(grid_map: GridMap, center: ArrayLike, radius: float) -> Cells:
    """Return the cells (rows, cols) of a disc from the inside out, ring by ring.

    The ring number of a cell is its distance from the center cell [cells], rounded down. A ring
    runs clockwise as seen from above and ends on the -x side of the center cell. The center cell is
    the cell that contains the center of the disc. If it is on the map, it comes first, even if its
    own center is outside the disc. The other cells are the same as those from `circle_cells`.

    Args:
        center: (2,) center of the disc [m]; it may be outside the map.
        radius: radius of the disc [m], not negative.
    """
    limit, center = checked_radius(radius), as_pair(center, "center")
    middle = _cell_under(grid_map.geometry, center)
    if limit < (KEPT_RINGS - 2) * grid_map.resolution:
        return _cut_out(grid_map, center, middle, limit)
    cells = circle_cells(grid_map, center, radius)
    # One axis at a time is sorted in place, to save memory.
    axes = list(zip(cells, middle, grid_map.start_index, grid_map.size, strict=True))
    for numbers, cell, start, size in axes:
        place(numbers, -start % size, size)
        numbers -= cell
    order = _spiral_order(*cells)
    for numbers, cell, start, size in axes:
        numbers[...] = numbers[order]
        numbers += cell
        place(numbers, start, size)
    return cells


def _cell_under(geometry: GridGeometry, position: Pair) -> Size:
    """Return the cell that contains a position, in map order; it may be outside the map."""
    steps = geometry._x.steps(position[0]), geometry._y.steps(position[1])
    row, column = (math.floor(max(min(step, FAR), -FAR)) for step in steps)
    if 0 <= row < geometry.size[0] and 0 <= column < geometry.size[1]:
        return row, column
    # Rounding may move a position from the border to the outside.
    if cell := geometry.cell_at(position):
        return cell
    tolerance = BORDER_TOLERANCE / geometry.resolution
    row, column = (math.floor(max(min(step + tolerance, FAR), -FAR)) for step in steps)
    return row, column


def _cut_out(grid_map: GridMap, center: Pair, middle: Size, limit: float) -> Cells:
    """Select the cells of a disc from the cached spiral."""
    geometry = grid_map.geometry
    to_border = min(*middle, *(n - 1 - cell for n, cell in zip(geometry.size, middle, strict=True)))
    if to_border < -KEPT_RINGS:
        return empty_cells(0)
    # Offset (x, y) of the center of the middle cell from the center of the disc [m].
    off_center = (
        geometry._x.center_of(middle[0]) - center[0],
        geometry._y.center_of(middle[1]) - center[1],
    )
    off = math.hypot(*off_center)
    reach = math.floor((limit + off) / geometry.resolution)
    # Number of rings entirely on the map and in the disc. The center cell counts as in the disc.
    whole = min(max(math.floor((limit - off) / geometry.resolution), 1), to_border + 1)
    spiral, ends = _kept_spiral()
    known = ends[max(whole, 0)]
    doubtful = spiral[:, known : ends[reach + 1]]
    x, y = (off_center[axis] - geometry.resolution * doubtful[axis] for axis in (0, 1))
    belong = x * x + y * y <= limit * limit
    if reach > to_border:
        for offsets, cell, size in zip(doubtful, middle, geometry.size, strict=True):
            belong &= (offsets >= -cell) & (offsets < size - cell)
    (found,) = belong.nonzero()
    cells = empty_cells(known + found.size)
    for axis, numbers in enumerate(cells):
        numbers[:known] = spiral[axis, :known]
        doubtful[axis].take(found, out=numbers[known:])
        numbers += middle[axis]
        place(numbers, grid_map.start_index[axis], geometry.size[axis])
    return cells


@cache
def _kept_spiral() -> tuple[Integers, list[int]]:
    """Return the cached spiral (2, N) around (0, 0), and the bounds of its rings."""
    side = np.arange(-KEPT_RINGS, KEPT_RINGS + 1)
    block = np.stack(np.meshgrid(side, side, indexing="ij")).reshape(2, -1)
    block = block[:, _rings(*block) < KEPT_RINGS]
    block = block[:, _spiral_order(*block)]
    rings = _rings(*block).astype(np.int64)
    return block, [0, *np.cumsum(np.bincount(rings)).tolist()]


def _spiral_order(rows: Integers, columns: Integers) -> Integers:
    """Return the indices (N,) that sort offsets from the center cell by ring, then clockwise."""
    # The factor 8 exceeds the range of the angle, 2 pi.
    key = 8.0 * _rings(rows, columns)
    key += np.arctan2(columns, -rows)
    return np.argsort(key)


def _rings(rows: Integers, columns: Integers) -> Positions:
    squares = rows * rows
    squares += columns * columns
    return np.asarray(np.floor(np.sqrt(squares)))
