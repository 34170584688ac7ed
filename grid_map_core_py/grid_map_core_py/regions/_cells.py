# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Cells of the whole map and of rectangular blocks, masks of cells, and what the shapes share."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from ..arrays._checks import Cells, Integers, Mask, as_finite, as_size
from ..errors import GeometryError
from ..map._geometry import BORDER_TOLERANCE
from ..map._grid_map import GridMap
from ..map._ring_buffer import place

_BAND = 2**13  # number of cells in a band, whose temporaries fit into the cache


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


def cells_of_mask(grid_map: GridMap, rows: slice, columns: slice, mask: Mask) -> Cells:
    """Return the cells (rows, cols) of a block where `mask` is true, row after row."""
    cells = empty_cells(int(np.count_nonzero(mask)))
    width, done = mask.shape[1], 0
    for band in bands(mask):
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


def bands(mask: Mask) -> Iterator[slice]:
    """Yield slices of rows whose cells fit into the cache."""
    step = max(_BAND // max(mask.shape[1], 1), 1)
    for first in range(0, mask.shape[0], step):
        yield slice(first, first + step)


def empty_cells(count: int) -> Cells:
    """Return uninitialized `count` rows and columns."""
    rows, columns = np.empty((2, count), dtype=np.int64)
    return rows, columns


def checked_radius(radius: float) -> float:
    """Return a checked radius [m], enlarged by the tolerance of the closed rim."""
    return as_finite(radius, "radius", least=0.0) + BORDER_TOLERANCE
