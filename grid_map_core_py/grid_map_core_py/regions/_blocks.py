# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Cells of the whole map and of rectangular blocks, and masks of cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays._checks import Cells, Mask, as_size
from ..errors import GeometryError
from ..map._ring_buffer import place
from ._assembly import empty_cells

if TYPE_CHECKING:
    from ..map._grid_map import GridMap


def map_cells(grid_map: GridMap) -> Cells:
    """Return all cells (rows, cols), column after column of the buffer."""
    rows, columns = grid_map.size
    cells = empty_cells(rows * columns)
    cells[0].reshape(columns, rows)[...] = np.arange(rows)
    cells[1].reshape(columns, rows)[...] = np.arange(columns)[:, None]
    return cells


def submap_cells(grid_map: GridMap, start_index: ArrayLike, size: ArrayLike) -> Cells:
    """Return the cells (rows, cols) of a block, row after row of the map.

    Cells beyond the map are left out.

    Args:
        start_index: buffer index of the block's cell with the largest x and y.
        size: rows and columns of the block, not negative.

    Raises:
        OutOfMapError: the start index is not on the map.
        GeometryError: a size is negative.
    """
    start, extent = as_size(start_index, "start_index"), as_size(size, "size")
    grid_map.geometry.check_cells(start)
    if min(extent) < 0:
        raise GeometryError(f"size: expected no negative numbers, got {extent}")
    rows, columns = (
        np.arange(min(count, cells - (cell - first) % cells))
        for count, cell, first, cells in zip(
            extent, start, grid_map.start_index, grid_map.size, strict=True
        )
    )
    place(rows, 0, start[0], grid_map.size[0])
    place(columns, 0, start[1], grid_map.size[1])
    return rows.repeat(columns.size), np.tile(columns, rows.size)


def cells_to_mask(grid_map: GridMap, cells: ArrayLike) -> Mask:
    """Return a mask (rows, cols) of the layers that is True in the given cells.

    Masks combine with `&`, `|` and `~`:

        ring = cells_to_mask(grid_map, circle_cells(grid_map, (0, 0), 2.0))
        ring &= ~cells_to_mask(grid_map, circle_cells(grid_map, (0, 0), 1.0))
        grid_map["elevation"][ring] = np.nan

    Args:
        cells: (rows, cols), as the regions return them, or (N, 2); buffer indices.

    Raises:
        OutOfMapError: there is no such cell.
    """
    chosen = grid_map.geometry.check_cells(cells, "cells")
    mask: Mask = np.zeros(grid_map.size, dtype=np.bool_, order="F")
    mask[chosen] = True
    return mask
