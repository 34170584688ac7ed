# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The cells of a rectangular block."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..arrays import Cells, Size, as_cells, as_size
from ..errors import GeometryError
from ._assembly import empty_cells, place

if TYPE_CHECKING:
    from ..grid_map import GridMap


def submap_cells(grid_map: "GridMap", start_index: npt.ArrayLike, size: npt.ArrayLike) -> Cells:
    """Return the (N, 2) buffer indices of a block of cells, row after row of the map.

    Args:
        start_index: buffer index of the block's cell with the largest x and y.
        size: rows and columns of the block.

    Raises:
        OutOfMapError: the start index is not on the map.
        GeometryError: the block reaches beyond the map, or a size is negative.
    """
    start, extent = as_size(start_index, "start_index"), as_size(size, "size")
    grid_map.geometry.check_cells(as_cells(start))
    _check_extent(grid_map, start, extent)
    rows, columns = (np.arange(count) for count in extent)
    place(rows, 0, start[0], grid_map.size[0])
    place(columns, 0, start[1], grid_map.size[1])
    cells = empty_cells(rows.size * columns.size)
    block = cells.T.reshape(2, *extent)
    block[0] = rows[:, None]
    block[1] = columns
    return cells


def _check_extent(grid_map: "GridMap", start: Size, extent: Size) -> None:
    for axis in (0, 1):
        first = (start[axis] - grid_map.start_index[axis]) % grid_map.size[axis]
        if not 0 <= extent[axis] <= grid_map.size[axis] - first:
            raise GeometryError(
                f"a block of {extent} cells at index {start} is not within the map of "
                f"{grid_map.size} cells with start index {grid_map.start_index}"
            )
