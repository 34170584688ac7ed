# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Layers from triangle meshes: the highest point of the mesh at each cell center."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.typing import ArrayLike

from ..arrays._checks import Integers, Layer, Mask, Positions, Size
from ..arrays._pieces import expanded
from ..errors import GeometryError, GridMapError
from ..map._geometry import BORDER_TOLERANCE, GridGeometry
from ..map._grid_map import GridMap
from ._point_layers import as_points, fitting_geometry

_TRIANGLES = 1 << 13  # number of triangles in a chunk, whose temporaries fit into the cache
# Number of pairs of a triangle and a cell in a chunk, whose temporaries fit into the cache.
_PAIRS = 1 << 13

_ROUNDING = 1e-9  # bound of the rounding error of the distance to an edge [cells]


def rasterize_triangles(
    vertices: ArrayLike, faces: ArrayLike, grid_map: GridMap, layer: str = "elevation"
) -> GridMap:
    """Return the map with a layer of the highest hits of vertical rays through the cell centers.

    Triangles are closed: a ray within 1e-9 m of an edge hits, so that no cell is missed where
    triangles meet. Triangles that are vertical, of no area or not finite are never hit.

    Args:
        vertices: (V, 3) x, y, z [m], map frame.
        faces: (F, 3) integers, the vertices of each triangle in any direction of turn; of polygons
            with n vertices (F, n), which are cut into fans from their first vertex.
        layer: name of the layer that is added or replaced.

    Returns:
        A map with the layer, NaN where nothing is hit. It shares the others with `grid_map` as
        described at `GridMap.with_layers`.

    Raises:
        GeometryError: an array has the wrong shape or type, or a face names no vertex.
    """
    corners = as_points(vertices, "vertices")
    triangles = as_triangles(faces, len(corners))
    highest = _highest_hits(corners, triangles, grid_map.geometry)
    if grid_map.start_index != (0, 0):
        highest = np.roll(highest, grid_map.start_index, axis=(0, 1))
    return grid_map.with_layers({layer: highest})


def from_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    resolution: float,
    layer: str = "elevation",
    *,
    frame_id: str = "",
    timestamp: int = 0,
) -> GridMap:
    """Return the smallest map that covers the finite vertices of all faces.

    Args:
        resolution: side of a cell [m].
        frame_id: frame of the vertices and of the map.
        timestamp: timestamp of the map [ns].

    Raises:
        GridMapError: no face has a finite vertex, or the extent takes too many cells; and all that
            `rasterize_triangles` raises.
    """
    corners = as_points(vertices, "vertices")
    triangles = as_triangles(faces, len(corners))
    used = np.zeros(len(corners), np.bool_)
    used[triangles] = True
    used &= np.isfinite(corners[:, :3]).all(axis=1)
    if not used.any():
        raise GridMapError("mesh: no face has a finite vertex")
    xy = corners[used, :2].astype(np.float64)
    geometry = fitting_geometry(xy.min(axis=0), xy.max(axis=0), resolution, hold_edges=False)
    grid_map = GridMap.from_geometry(geometry, frame_id=frame_id, timestamp=timestamp)
    return grid_map.with_layers({layer: _highest_hits(corners, triangles, geometry)})


def as_triangles(faces: ArrayLike, vertices: int) -> npt.NDArray[Any]:
    """Return faces as (F, 3) integers, polygons cut into fans from their first vertex.

    Args:
        faces: (F, n) integers, n >= 3.
        vertices: number of vertices.

    Raises:
        GeometryError: the shape or type is another, or a face names a vertex that does not exist.
    """
    try:
        given = np.asarray(faces)
    except ValueError as error:
        raise GeometryError(
            f"faces: expected the same number of vertices in each, got {faces!r}"
        ) from error
    if given.ndim != 2 or given.shape[1] < 3 or given.dtype.kind not in "iu":
        raise GeometryError(
            f"faces: expected integers of shape (F, 3), got {given.dtype} of shape {given.shape}"
        )
    if given.size and not 0 <= given.min() <= given.max() < vertices:
        raise GeometryError(
            f"faces: expected vertices from 0 to {vertices - 1}, got {given.min()} to {given.max()}"
        )
    if given.shape[1] == 3:
        return given
    return np.concatenate([given[:, [0, n, n + 1]] for n in range(1, given.shape[1] - 1)])


def _highest_hits(
    vertices: npt.NDArray[Any], triangles: npt.NDArray[Any], geometry: GridGeometry
) -> Layer:
    """Return the highest hits (rows, cols) in map order."""
    highest = np.full(geometry.size[0] * geometry.size[1], np.nan, np.float32)
    first_center = geometry.corner - 0.5 * geometry.resolution
    tolerance = BORDER_TOLERANCE / geometry.resolution + _ROUNDING
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        for first in range(0, len(triangles), _TRIANGLES):
            corners = vertices[triangles[first : first + _TRIANGLES].T]
            x, y, z = (corners[..., axis].astype(np.float64, order="C") for axis in (0, 1, 2))
            rows = (first_center[0] - x) / geometry.resolution
            columns = (first_center[1] - y) / geometry.resolution
            part = _Triangles(rows, columns, z, tolerance)
            for cells, heights in part.hits(geometry.size):
                np.fmax.at(highest, cells, heights.astype(np.float32))
    return highest.reshape(geometry.size, order="F")


class _Triangles:
    """Triangles over a map whose cell centers have whole numbers as row and column.

    Args:
        rows, columns, z: (3, T) of the corners.
        tolerance: distance from a center to an edge that still counts as a hit [cells].
    """

    def __init__(self, rows: Positions, columns: Positions, z: Positions, tolerance: float) -> None:
        along_rows, along_columns = _edges(rows), _edges(columns)
        area = along_rows[2] * along_columns[0] - along_rows[0] * along_columns[2]
        lengths = np.hypot(along_rows, along_columns)
        # A triangle that is thinner than the tolerance is vertical or has no area.
        kept = np.isfinite(z).all(axis=0) & (np.abs(area) > tolerance * lengths.max(axis=0))
        kept_of = partial(np.compress, kept, axis=-1)
        self._rows, self._columns, self._z = kept_of(rows), kept_of(columns), kept_of(z)
        area = kept_of(area)
        self._by_row, self._by_column = -kept_of(along_columns) / area, kept_of(along_rows) / area
        self._slack = tolerance * kept_of(lengths) / np.abs(area)
        self._tolerance = tolerance

    def hits(self, size: Size) -> Iterator[tuple[Integers, Positions]]:
        """Yield the numbers (n,) of cells, column after column, and the heights (n,) there."""
        first_row, row_count = self._range(self._rows, size[0])
        first_column, column_count = self._range(self._columns, size[1])
        for triangles, numbers in expanded(row_count * column_count, _PAIRS):
            strides = row_count[triangles]
            beside = numbers // strides
            rows = first_row[triangles] + numbers - beside * strides
            columns = first_column[triangles] + beside
            hit, heights = self._heights(triangles, rows, columns)
            yield (rows + size[0] * columns)[hit], heights[hit]

    def _range(self, corners: Positions, cells: int) -> tuple[Integers, Integers]:
        """Return the first cell under each triangle along one axis, and how many there are."""
        first = np.ceil(np.clip(corners.min(axis=0) - self._tolerance, 0, cells))
        last = np.floor(np.clip(corners.max(axis=0) + self._tolerance, -1, cells - 1))
        return first.astype(np.int64), np.maximum(last - first + 1, 0).astype(np.int64)

    def _heights(
        self, triangles: Integers, rows: Integers, columns: Integers
    ) -> tuple[Mask, Positions]:
        """Return a mask of the triangles that contain the cell centers, and their heights there.

        Heights are weighted by barycentric coordinates: linear over the triangle, 1 at one corner
        and 0 along the edge opposite.
        """
        # Offsets from a corner keep their precision far from the first cell.
        row, column = rows - self._rows[0][triangles], columns - self._columns[0][triangles]
        weights = [
            row * self._by_row[n][triangles] + column * self._by_column[n][triangles]
            for n in (1, 2)
        ]
        weights.insert(0, 1.0 - weights[0] - weights[1])
        hit = np.ones(len(triangles), np.bool_)
        heights, total = np.zeros(len(triangles)), np.zeros(len(triangles))
        for weight, slack, z in zip(weights, self._slack, self._z, strict=True):
            hit &= weight >= -slack[triangles]
            # Extrapolation of a steep triangle beyond its edge would be far off.
            np.maximum(weight, 0.0, out=weight)
            heights += weight * z[triangles]
            total += weight
        return hit, heights / total


def _edges(corners: Positions) -> Positions:
    """Return the extent (3, T) along one axis of the edge opposite to each corner."""
    first, second, third = corners
    return np.array([third - second, first - third, second - first])
