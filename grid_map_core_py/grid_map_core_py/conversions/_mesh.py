# SPDX-License-Identifier: BSD-3-Clause
"""Convert triangle meshes to layers with the largest mesh height at each cell center."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Positions, Size, as_points
from .._arrays._pieces import expanded, slices
from ..errors import GeometryError, GridMapError, short
from ..limits import check_visits
from ..map._axis import BORDER_TOLERANCE
from ..map._grid_map import GridMap
from ._point_layers import fitting_geometry

# Number of triangles, or of triangle-cell pairs, per chunk, so that temporaries fit the cache.
_TRIANGLES = _PAIRS = 1 << 13

_ROUNDING = 1e-9  # largest rounding error of a distance to an edge [cells]


def rasterize_triangles(
    vertices: ArrayLike, faces: ArrayLike, grid_map: GridMap, layer: str = "elevation"
) -> GridMap:
    """Return a map with a new layer: the largest mesh height [m] at each cell center.

    A triangle also covers centers up to 1e-9 m outside its edges, so that no center on the edge
    between two triangles is missed. Triangles that are vertical, have zero area or are not finite
    are ignored.

    Args:
        vertices: (V, 3) x, y, z [m], map frame.
        faces: (F, 3) vertex indices of each triangle, clockwise or counterclockwise. Polygons
            (F, n) with n vertices are split into triangles that share the first vertex.
        layer: name of the layer that is added or replaced.

    Returns:
        A map with the layer; cells that no triangle covers are NaN. The map shares all other layers
        with `grid_map`, as described in `GridMap.with_layers`.

    Raises:
        GeometryError: an array has the wrong shape or type, or a vertex index is out of range.
        LimitError: the bounding rectangles of all triangles contain more than four times
            `max_cells` cells.
    """
    corners = as_points(vertices, "vertices")
    triangles = as_triangles(faces, len(corners))
    geometry = grid_map.geometry
    rows = geometry.size[0]
    highest = np.full(rows * geometry.size[1], np.nan, np.float32)
    first_center = geometry.corner - 0.5 * geometry.resolution
    tolerance = BORDER_TOLERANCE / geometry.resolution + _ROUNDING
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        visits = 0
        for part in slices(len(triangles), _TRIANGLES):
            chosen = corners[triangles[part].T]
            x, y, z = (chosen[..., axis].astype(np.float64, order="C") for axis in (0, 1, 2))
            along_rows = (first_center[0] - x) / geometry.resolution
            along_columns = (first_center[1] - y) / geometry.resolution
            prepared = _prepared(along_rows, along_columns, z, geometry.size, tolerance)
            visits += int(prepared.counts.sum())
            check_visits("faces", visits)
            is_large = prepared.counts > _PAIRS
            found = [_hits_of_small(_Triangles._make(a[..., ~is_large] for a in prepared), rows)]
            for place in np.flatnonzero(is_large):
                large = _Triangles._make(a[..., place] for a in prepared)
                found.append(_hits_of_large(large, rows))
            for cells, heights in chain.from_iterable(found):
                np.fmax.at(highest, cells, heights.astype(np.float32))
    made = {layer: highest.reshape(geometry.size, order="F")}
    return grid_map.with_layers(GridMap.from_geometry(geometry).with_layers(made))


def from_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    resolution: float,
    layer: str = "elevation",
    *,
    frame_id: str = "",
    timestamp: int = 0,
) -> GridMap:
    """Create the smallest map that covers the finite vertices of all faces of a mesh.

    Arguments and errors not listed here are as in `rasterize_triangles`.

    Args:
        resolution: side of a cell [m].
        frame_id: frame of the vertices and of the map.
        timestamp: timestamp of the map [ns].

    Raises:
        GridMapError: no face has a finite vertex.
        LimitError: the map would have too many cells.
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
    return rasterize_triangles(corners, triangles, grid_map, layer)


def as_triangles(faces: ArrayLike, vertices: int) -> NDArray[Any]:
    """Split polygons (F, n) into triangles that share the first vertex of their polygon."""
    try:
        given = np.asarray(faces)
    except ValueError as error:
        raise GeometryError(
            f"faces: expected the same number of vertices in each, got {short(faces)}"
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


class _Triangles(NamedTuple):
    """Triangles that may cover cell centers; horizontal lengths are in cells.

    Attributes:
        row, column: (T,) first corner of each triangle.
        by_row, by_column: (3, T) change of each barycentric coordinate per row and per column.
        slacks: (3, T) tolerances; covered cells have barycentric coordinates >= -slack.
        heights: (3, T) heights of the corners [m].
        first_row, row_count, first_column, column_count: (T,) bounding rectangles.
        counts: (T,) number of cells in each bounding rectangle.
    """

    row: Positions
    column: Positions
    by_row: Positions
    by_column: Positions
    slacks: Positions
    heights: Positions
    first_row: Integers
    row_count: Integers
    first_column: Integers
    column_count: Integers
    counts: Integers


def _prepared(
    rows: Positions, columns: Positions, z: Positions, size: Size, tolerance: float
) -> _Triangles:
    """Return the finite triangles that are not vertical and have a nonzero area.

    `rows` and `columns` (3, T) are the corners [cells]. Cell centers are at integers.
    """
    along_rows, along_columns = _edges(rows), _edges(columns)
    area = along_rows[2] * along_columns[0] - along_rows[0] * along_columns[2]
    lengths = np.hypot(along_rows, along_columns)
    # Triangles thinner than the tolerance are treated as vertical or of zero area.
    kept = np.isfinite(z).all(axis=0) & (np.abs(area) > tolerance * lengths.max(axis=0))
    rows, columns, z, along_rows, along_columns, lengths, area = (
        np.compress(kept, values, axis=-1)
        for values in (rows, columns, z, along_rows, along_columns, lengths, area)
    )
    first_row, row_count = _range(rows, size[0], tolerance)
    first_column, column_count = _range(columns, size[1], tolerance)
    return _Triangles(
        rows[0],
        columns[0],
        -along_columns / area,
        along_rows / area,
        tolerance * lengths / np.abs(area),
        z,
        *(first_row, row_count, first_column, column_count, row_count * column_count),
    )


def _hits_of_small(triangles: _Triangles, map_rows: int) -> Iterator[tuple[Integers, Positions]]:
    """Yield the column-major indices (n,) of covered cells, and the mesh heights (n,) [m]."""
    for numbers, members in expanded(triangles.counts, _PAIRS):
        strides = triangles.row_count[numbers]
        beside = members // strides
        cell_rows = triangles.first_row[numbers] + members - beside * strides
        cell_columns = triangles.first_column[numbers] + beside
        # Offsets from a corner are precise even far from the first cell.
        row, column = cell_rows - triangles.row[numbers], cell_columns - triangles.column[numbers]
        first, second = (
            row * triangles.by_row[n][numbers] + column * triangles.by_column[n][numbers]
            for n in (1, 2)
        )
        weights, hits = _inside(first, second, [slack[numbers] for slack in triangles.slacks])
        found = numbers.take(hits)
        corners = [height[found] for height in triangles.heights]
        yield (cell_rows + map_rows * cell_columns).take(hits), _heights(weights, hits, corners)


def _hits_of_large(triangle: _Triangles, map_rows: int) -> Iterator[tuple[Integers, Positions]]:
    """Yield the results of `_hits_of_small` for one large triangle."""
    cell_rows = triangle.first_row + np.arange(int(triangle.row_count))
    cell_columns = triangle.first_column + np.arange(int(triangle.column_count))
    rows, columns = cell_rows - triangle.row, cell_columns - triangle.column
    for part in slices(len(columns), _PAIRS // len(rows)):
        first, second = (
            rows * triangle.by_row[n] + (columns[part] * triangle.by_column[n])[:, None]
            for n in (1, 2)
        )
        weights, hits = _inside(first, second, triangle.slacks)
        if len(hits):
            cells = (cell_rows + map_rows * cell_columns[part, None]).take(hits)
            yield cells, _heights(weights, hits, triangle.heights)


def _inside(
    first: Positions, second: Positions, slacks: Sequence[Positions] | Positions
) -> tuple[tuple[Positions, ...], Integers]:
    """Return the barycentric coordinates of cells, and the indices (n,) of covered cells."""
    weights = 1.0 - first - second, first, second
    hit = weights[0] >= -slacks[0]
    hit &= first >= -slacks[1]
    hit &= second >= -slacks[2]
    return weights, np.flatnonzero(hit)


def _heights(
    weights: Iterable[Positions], hits: Integers, corners: Iterable[Positions]
) -> Positions:
    heights, total = np.zeros(len(hits)), np.zeros(len(hits))
    for weight, height in zip(weights, corners, strict=True):
        # Clamped, because extrapolating a steep triangle beyond an edge causes large errors.
        inside = np.maximum(weight.take(hits), 0.0)
        heights += inside * height
        total += inside
    return heights / total


def _range(corners: Positions, cells: int, tolerance: float) -> tuple[Integers, Integers]:
    """Return the first row or column under each triangle, and the number of rows or columns."""
    first = np.ceil(np.clip(corners.min(axis=0) - tolerance, 0, cells))
    last = np.floor(np.clip(corners.max(axis=0) + tolerance, -1, cells - 1))
    return first.astype(np.int64), np.maximum(last - first + 1, 0).astype(np.int64)


def _edges(corners: Positions) -> Positions:
    """Return the signed lengths (3, T), along one axis, of the edges opposite the corners."""
    first, second, third = corners
    return np.array([third - second, first - third, second - first])
