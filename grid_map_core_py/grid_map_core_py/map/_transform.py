# SPDX-License-Identifier: BSD-3-Clause
"""Transforms maps to another coordinate frame."""

from __future__ import annotations

import math
from itertools import product
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Positions, as_finite, as_rigid
from .._arrays._pieces import slices
from ._axis import BORDER_TOLERANCE
from ._geometry import GridGeometry

if TYPE_CHECKING:
    from ._grid_map import GridMap

_BLOCK = 1 << 14  # cells transformed at a time; their points fit into the cache

_Indices: TypeAlias = NDArray[np.intp]


def transformed_map(
    grid_map: GridMap, transform: ArrayLike, height_layer: str, frame_id: str, sample_ratio: float
) -> GridMap:
    matrix = as_rigid(transform)
    ratio = as_finite(sample_ratio, "sample_ratio")
    step = ratio * grid_map.resolution
    steps = [(0.0, 0.0)]
    if ratio > 0:
        steps += [(-step, 0.0), (step, 0.0), (0.0, -step), (0.0, step)]
    # The new grid is the smallest one that contains the transformed corners at z = 0. The center is
    # summed in the same order as in C++, so that rounding is equal. The length is not computed from
    # the corners, because coordinates far from the origin are imprecise.
    x, y = (grid_map.position + np.outer((0.5, -0.5), grid_map.length)).T
    center = np.array([_moved(row, x, y, row[3]).T.reshape(-1).mean() for row in matrix[:2]])
    length = np.abs(matrix[:2, :2]) @ grid_map.length
    size = np.ceil((length - BORDER_TOLERANCE) / grid_map.resolution)
    # If the map is seen edge-on, the corners span no area.
    sides = np.maximum(size, 1) * grid_map.resolution
    geometry = GridGeometry(sides, grid_map.resolution, center)
    highest, sources = _seen_from_above(grid_map, height_layer, geometry, matrix[:3], steps)
    is_empty = ~np.isfinite(highest)
    layers = {}
    for name in grid_map:
        values = grid_map.unwrapped(name).ravel("F")[sources] if name != height_layer else highest
        values[is_empty] = np.nan
        layers[name] = values.reshape(geometry.size, order="F")
    result = grid_map._with(layers, geometry, (0, 0))
    result.frame_id, result.crs = frame_id, ""
    return result


def _moved(row: Positions, x: Positions, y: Positions, lift: Positions | float) -> Positions:
    """Return one transformed coordinate (cols, rows) of points at x (rows,) and y (cols,)."""
    moved: Positions = row[0] * x + (row[1] * y)[:, None]
    moved += lift
    return moved


def _seen_from_above(
    grid_map: GridMap,
    height_layer: str,
    geometry: GridGeometry,
    matrix: Positions,
    steps: list[tuple[float, float]],
) -> tuple[NDArray[np.float32], _Indices]:
    """Return the height of the highest point in each new cell, and the index of its source cell.

    Each source cell has one point per offset (dx, dy) [m] from its center in `steps`. Both results
    are in column-major order. Cells without points get the height -inf. If several points are
    equally high, the last source cell wins.
    """
    heights = grid_map.unwrapped(height_layer)
    x, y = grid_map.geometry.axes_in_map_order()
    all_numbers = np.arange(heights.size).reshape(y.size, x.size)
    # With NaN instead of -inf, computing maxima would take twice as long.
    highest = np.full(math.prod(geometry.size), -np.inf, dtype=np.float32)
    sources = np.zeros(highest.size, dtype=np.intp)
    for columns, rows in product(slices(y.size, _BLOCK // x.size), slices(x.size, _BLOCK)):
        z = heights[rows, columns].T.astype(np.float64)
        missing = ~np.isfinite(z)
        np.copyto(z, 0.0, where=missing)
        lifts = [row[2] * z + row[3] for row in matrix]
        np.copyto(lifts[2], -np.inf, where=missing)
        landed = []
        for dx, dy in steps:
            moved = (
                _moved(row, x[rows] + dx, y[columns] + dy, lift)
                for row, lift in zip(matrix, lifts, strict=True)
            )
            landed.append(_landed(geometry, *moved))
            np.maximum.at(highest, *landed[-1])
        if len(grid_map) > 1:
            # One row per source cell keeps the sources in order.
            cells, found = (np.stack(parts, axis=-1) for parts in zip(*landed, strict=True))
            stays = highest[cells] == found
            numbers = all_numbers[columns, rows].reshape(-1, 1)
            sources[cells[stays]] = np.broadcast_to(numbers, stays.shape)[stays]
    return highest, sources


def _landed(
    geometry: GridGeometry, x: Positions, y: Positions, z: Positions
) -> tuple[_Indices, NDArray[np.float32]]:
    """Return the column-major cell and the height (N,) of each point; -inf outside the grid."""
    row, column = x - 0.5 * geometry.length[0], y - 0.5 * geometry.length[1]
    for axis, offsets in enumerate((row, column)):
        offsets -= geometry.position[axis]
        offsets /= -geometry.resolution
    rows, columns = geometry.size
    with np.errstate(over="ignore"):
        heights = z.astype(np.float32)
    if row.min() < 0 or row.max() >= rows or column.min() < 0 or column.max() >= columns:
        outside = (row < 0) | (row >= rows) | (column < 0) | (column >= columns)
        row[outside] = column[outside] = 0
        heights[outside] = -np.inf
    cells = np.trunc(column, out=column)
    cells *= rows
    cells += np.trunc(row, out=row)
    return cells.astype(np.intp).reshape(-1), heights.reshape(-1)
