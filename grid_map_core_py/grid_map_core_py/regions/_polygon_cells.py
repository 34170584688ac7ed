# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Cells of a polygon (scan conversion)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from ..arrays._checks import Cells, Mask, Positions
from ._assembly import cells_of_mask, empty_cells
from ._polygon import Polygon, edge_x

if TYPE_CHECKING:
    from ..map._grid_map import GridMap


def polygon_cells(grid_map: GridMap, polygon: Polygon | ArrayLike) -> Cells:
    """Return the cells (rows, cols) whose center is in a polygon, row after row.

    They are those whose center `Polygon.is_inside` takes, without the cells beyond the map.

    Args:
        polygon: a polygon, or its (V, 2) vertices [m].

    Raises:
        GeometryError: the vertices have another shape or are not finite.
    """
    vertices = Polygon.of(polygon).vertices
    if not len(vertices):
        return empty_cells(0)
    rows, columns = grid_map.geometry.box(vertices.min(axis=0), vertices.max(axis=0))
    x, y = grid_map.geometry.axes_in_map_order()
    mask = _inside(x[rows], y[columns], vertices)
    return cells_of_mask(grid_map, rows, columns, mask)


def _inside(x: Positions, y: Positions, vertices: Positions) -> Mask:
    """Return which centers, x (rows,) by y (cols,), both descending, are in a polygon.

    An edge flips the cells of a column that are below the x where it crosses the column.
    """
    start, end, columns = _crossings(y, vertices)
    crossed = edge_x(start, end, y[columns])
    first_below = (-x).searchsorted(-crossed, side="right")
    flips = np.zeros((x.size + 1, y.size), dtype=np.uint8)
    np.add.at(flips.reshape(-1), first_below * y.size + columns, np.uint8(1))
    np.add.accumulate(flips, axis=0, dtype=np.uint8, out=flips)
    flips &= 1
    return flips[:-1].view(np.bool_)


def _crossings(
    y: Positions, vertices: Positions
) -> tuple[Positions, Positions, npt.NDArray[np.int64]]:
    """Return for every crossing of an edge and a column the edge's two ends and the column.

    As in `Polygon.is_inside`, a column crosses an edge when one end is above it and one does not.
    """
    below = (-y).searchsorted(-vertices[:, 1], side="right")
    before = np.arange(-1, below.size - 1)
    first = np.minimum(below, below[before])
    counts = np.abs(below - below[before])
    edges = np.arange(len(vertices)).repeat(counts)
    columns = np.arange(edges.size) + (first + counts - counts.cumsum()).repeat(counts)
    return vertices[edges], vertices[edges - 1], columns
