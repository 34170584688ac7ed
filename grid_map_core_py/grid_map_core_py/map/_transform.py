# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps in another coordinate frame."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from ..arrays._checks import Layer, Mask, Positions, Size, as_finite
from ..errors import GeometryError
from ._geometry import BORDER_TOLERANCE, GridGeometry

if TYPE_CHECKING:
    from ._grid_map import GridMap

ROTATION_TOLERANCE = 1e-3
"""Tolerance of R^T R = I for a rotation R, so that rounded numbers pass."""

_SMALL_BLOCK, _LARGE_BLOCK = 1 << 13, 1 << 14
"""Number of cells transformed at a time, in a small and in a large map.

Fewer cost more in calls than they save in the cache; more would outweigh a small map.
"""

_Indices: TypeAlias = npt.NDArray[np.intp]


def transformed_map(
    grid_map: GridMap,
    transform: ArrayLike,
    height_layer: str,
    frame_id: str,
    sample_ratio: float = 0.0,
) -> GridMap:
    """Return `grid_map` in another frame; see `GridMap.get_transformed_map`."""
    matrix = _as_rigid(transform)
    ratio = as_finite(sample_ratio, "sample_ratio")
    step = ratio * grid_map.resolution
    steps = [(0.0, 0.0)]
    if ratio > 0:
        steps += [(-step, 0.0), (step, 0.0), (0.0, -step), (0.0, step)]
    x, y = grid_map.geometry.axes_in_map_order()
    heights = grid_map.unwrapped(height_layer)
    others = [name for name in grid_map if name != height_layer]
    surface = _Surface(_footprint(grid_map.geometry, matrix), with_sources=bool(others))
    result = grid_map.from_geometry(
        surface.geometry, frame_id=frame_id, timestamp=grid_map.timestamp
    )
    for rows, columns in _blocks(grid_map.size):
        points = _points(x[rows], y[columns], heights[rows, columns], matrix[:3], steps)
        # Cells are numbered column after column.
        numbers = np.arange(columns.start, columns.stop)[:, None] * x.size
        surface.add(points, numbers + np.arange(rows.start, rows.stop))
    # It may be a copy, whose memory the next layers can reuse.
    del heights, points
    layers = {name: surface.carried(grid_map.unwrapped(name)) for name in others}
    layers[height_layer] = surface.layer
    result = result.with_layers({name: layers[name] for name in grid_map})
    result.basic_layers = grid_map.basic_layers
    return result


def _as_rigid(transform: ArrayLike) -> Positions:
    """Return a transform as (4, 4) float64 after checking that it keeps distances."""
    try:
        # dtype=object prevents silent conversions, for example of complex numbers.
        matrix = np.asarray(transform, dtype=object).astype(np.float64)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise GeometryError(f"transform: expected (4, 4) finite numbers, got {transform!r}")
    if not np.allclose(matrix[3], (0, 0, 0, 1), rtol=0, atol=1e-9):
        raise GeometryError(
            f"transform: expected (0, 0, 0, 1) as the last row, got {tuple(matrix[3].tolist())}"
        )
    rotation = matrix[:3, :3]
    error = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if error > ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        raise GeometryError(
            f"transform: expected a rotation and a translation, but it scales, shears or mirrors: "
            f"{rotation.tolist()}"
        )
    return matrix


def _footprint(geometry: GridGeometry, matrix: Positions) -> GridGeometry:
    """Return the smallest grid around the moved corners at height 0."""
    x, y = (geometry.position + np.outer((0.5, -0.5), geometry.length)).T
    # Summed in this order, the mean is rounded as in the C++ library.
    center = np.array([_moved(row, x, y, row[3]).T.reshape(-1).mean() for row in matrix[:2]])
    # Differences of corners would lose digits far from the origin.
    length = np.abs(matrix[:2, :2]) @ geometry.length
    size = np.ceil((length - BORDER_TOLERANCE) / geometry.resolution)
    # Seen edge-on, the corners have no extent.
    return GridGeometry(np.maximum(size, 1) * geometry.resolution, geometry.resolution, center)


def _moved(row: Positions, x: Positions, y: Positions, lift: Positions | float) -> Positions:
    """Return one coordinate (cols, rows) of moved points.

    Args:
        row: (4,) of the transform, for this coordinate.
        x: (rows,) before the move.
        y: (cols,) before the move.
        lift: sum of height and translation, per point or for all points.
    """
    moved: Positions = row[0] * x + (row[1] * y)[:, None]
    moved += lift
    return moved


def _blocks(size: Size) -> Iterator[tuple[slice, slice]]:
    """Yield blocks of rows and columns of a map, column after column."""
    block = min(max(_SMALL_BLOCK, math.prod(size) // 12), _LARGE_BLOCK)
    height = min(size[0], block)
    width = max(1, block // height)
    for column in range(0, size[1], width):
        columns = slice(column, min(column + width, size[1]))
        for row in range(0, size[0], height):
            yield slice(row, min(row + height, size[0])), columns


def _points(
    x: Positions,
    y: Positions,
    heights: Layer,
    matrix: Positions,
    steps: list[tuple[float, float]],
) -> Iterator[list[Positions]]:
    """Yield, for every step, moved x, y, z (cols, rows) of cells; -inf in z where no height is.

    Args:
        x, y: (rows,) and (cols,) centers of the cells [m].
        heights: (rows, cols) z [m].
        matrix: (3, 4) how they move.
        steps: (dx, dy) [m] from the center of a cell to each of its points.
    """
    z = heights.T.astype(np.float64)
    missing = ~np.isfinite(z)
    np.copyto(z, 0.0, where=missing)
    lifts = [row[2] * z + row[3] for row in matrix]
    np.copyto(lifts[2], -np.inf, where=missing)
    for dx, dy in steps:
        yield [_moved(row, x + dx, y + dy, lift) for row, lift in zip(matrix, lifts, strict=True)]


class _Surface:
    """The highest point in each cell of a grid.

    Args:
        geometry: geometry of the grid.
        with_sources: True to keep the source cell of each highest point.
    """

    def __init__(self, geometry: GridGeometry, *, with_sources: bool) -> None:
        self.geometry = geometry
        cells = math.prod(geometry.size)
        # Both column after column, as layers are stored. NaN would make maxima twice as slow.
        self._heights = np.full(cells, -np.inf, dtype=np.float32)
        self._sources = np.zeros(cells, dtype=np.intp) if with_sources else None

    @property
    def layer(self) -> Layer:
        """(rows, cols) z of the highest points [m]; NaN where none came down."""
        self._heights[self._is_empty] = np.nan
        return self._heights.reshape(self.geometry.size, order="F")

    def carried(self, layer: Layer) -> Layer:
        """Return the values (rows, cols) of a layer in the cells where the points came from."""
        values = layer.ravel("F")[self._sources]
        values[self._is_empty] = np.nan
        return values.reshape(self.geometry.size, order="F")

    def add(self, points: Iterable[list[Positions]], sources: _Indices) -> None:
        """Drop points onto the grid, several from each source.

        Among points of equal height, the one of the last source stays.

        Args:
            points: x, y, z [m], each of the shape of `sources`; -inf in z is no point.
            sources: number of the cell that the points came from.
        """
        landed = []
        for point in points:
            cells, heights = self._landed(*point)
            np.maximum.at(self._heights, cells, heights)
            if self._sources is not None:
                landed.append((cells, heights))
        if self._sources is not None:
            # One row per source, so that they keep their order.
            cells, heights = (np.stack(parts, axis=-1) for parts in zip(*landed, strict=True))
            highest = self._heights[cells] == heights
            self._sources[cells[highest]] = sources.reshape(-1)[np.nonzero(highest)[0]]

    @property
    def _is_empty(self) -> Mask:
        return ~np.isfinite(self._heights)

    def _landed(
        self, x: Positions, y: Positions, z: Positions
    ) -> tuple[_Indices, npt.NDArray[np.float32]]:
        """Return the cells under points, counted column after column, and their heights.

        Points beside the grid get the height -inf.
        """
        row, column = self._offsets(x, 0), self._offsets(y, 1)
        rows, columns = self.geometry.size
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

    def _offsets(self, values: Positions, axis: int) -> Positions:
        """Return the distance of x or y from the corner in rows or columns, with fractions."""
        offsets: Positions = values - 0.5 * self.geometry.length[axis]
        offsets -= self.geometry.position[axis]
        offsets /= -self.geometry.resolution
        return offsets
