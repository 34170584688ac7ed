# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The cells of a rectangular block."""

import numpy as np
import numpy.typing as npt

from ..arrays import Cells, as_cells, as_size
from ..errors import GeometryError
from ..grid_map import GridMap
from ..ring_buffer import unwrap, wrap


def submap_cells(grid_map: GridMap, start_index: npt.ArrayLike, size: npt.ArrayLike) -> Cells:
    """Return the (N, 2) buffer indices of a block of cells, row after row of the map.

    Args:
        start_index: buffer index of the block's cell with the largest x and y.
        size: rows and columns of the block.

    Raises:
        OutOfMapError: the start index is not on the map.
        GeometryError: the block reaches beyond the map, or a size is negative.
    """
    start = as_size(start_index, "start_index")
    rows, columns = as_size(size, "size")
    grid_map.geometry.check_cells(as_cells(start))
    first = unwrap(start, grid_map.start_index, grid_map.size)
    if rows < 0 or columns < 0 or (first + (rows, columns) > grid_map.size).any():
        raise GeometryError(
            f"a block of {(rows, columns)} cells at index {start} is not within the map of "
            f"{grid_map.size} cells with start index {grid_map.start_index}"
        )
    block = np.empty((rows, columns, 2), dtype=np.int64)
    block[..., 0] = first[0] + np.arange(rows)[:, None]
    block[..., 1] = first[1] + np.arange(columns)[None, :]
    return wrap(block.reshape(-1, 2), grid_map.start_index, grid_map.size)
