# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The cells of a rectangular block."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..arrays._checks import Cells, Size, as_cells, as_size
from ..errors import GeometryError
from ._assembly import empty_cells, place

if TYPE_CHECKING:
    from ..map._grid_map import GridMap


def submap_cells(grid_map: "GridMap", start_index: npt.ArrayLike, size: npt.ArrayLike) -> Cells:
    """Return the (N, 2) buffer indices of a block of cells, row after row of the map.

    Cells beyond the map are left out.

    Args:
        start_index: buffer index of the block's cell with the largest x and y.
        size: rows and columns of the block, not negative.

    Raises:
        OutOfMapError: the start index is not on the map.
        GeometryError: a size is negative.
    """
    start = as_size(start_index, "start_index")
    grid_map.geometry.check_cells(as_cells(start))
    extent = _clipped(grid_map, start, as_size(size, "size"))
    rows, columns = (np.arange(count) for count in extent)
    place(rows, 0, start[0], grid_map.size[0])
    place(columns, 0, start[1], grid_map.size[1])
    cells = empty_cells(rows.size * columns.size)
    block = cells.T.reshape(2, *extent)
    block[0] = rows[:, None]
    block[1] = columns
    return cells


def _clipped(grid_map: "GridMap", start: Size, extent: Size) -> Size:
    """Return how many rows and columns of a block that begins at a buffer index are on the map."""
    if min(extent) < 0:
        raise GeometryError(f"size: expected no negative numbers, got {extent}")
    rows, columns = (
        min(count, cells - (cell - first) % cells)
        for count, cell, first, cells in zip(
            extent, start, grid_map.start_index, grid_map.size, strict=True
        )
    )
    return rows, columns
