# SPDX-License-Identifier: BSD-3-Clause
"""Triangulate a height layer for markers and meshes.

The corners of the triangles are cell centers. A square of four neighboring cells becomes two
triangles if all four heights are finite. It becomes one triangle if three heights are finite, and a
hole otherwise. The square is split along the diagonal with the smaller height difference, so that
edges and ridges are straight. If the differences are equal, the higher diagonal is used.

If a map has more than `max_drawn_cells` cells, only the border and every n-th row and column are
kept. Values are not averaged. Rows and columns are chosen by their position in the map frame.
Therefore, the surface of a moving map does not flicker.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import count, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer, Mask, Positions
from grid_map_core_py.plugins import check

from .colors import Coloring, Colors

__all__ = ["Mesh", "Surface"]


def check_max_drawn_cells(max_drawn_cells: int) -> None:
    """Raise `ConfigError` unless `max_drawn_cells` is 0 (no limit) or at least 9."""
    # A downsampled map may have three rows and columns: first, inner, and last.
    is_limit = max_drawn_cells == 0 or max_drawn_cells >= 9
    check(is_limit, "max_drawn_cells", "0 (never thin out) or at least 9", max_drawn_cells)


@dataclass(frozen=True)
class Mesh:
    """Indexed triangle mesh.

    Attributes:
        origin: (3,) origin of the vertices: the center of the map at height zero [m], map frame.
        vertices: (N, 3) float32 x, y, z relative to `origin` [m], all finite.
        faces: (M, 3) uint32 vertex indices; counter-clockwise, seen from above.
        colors: (N, 3) uint8 red, green, blue of each vertex.
    """

    origin: Positions
    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    colors: Colors


@dataclass(frozen=True, eq=False)
class Surface:
    """Surface of a map: the shown cells and the triangles between cell centers.

    Arrays of cells have the shape (columns, rows); they are transposed layers in map order.
    Triangles refer to cells by index in the flattened array.

    Args:
        grid_map: the map.
        height_layer: height layer [m]; cells without a finite height are holes.
        flat: draw the surface at height zero, with the same holes.
        max_drawn_cells: maximum number of cells, at least 9; 0 means no limit.

    Raises:
        LayerNotFoundError: the map lacks a layer that a method needs.
        ConfigError: `max_drawn_cells` is negative or too small.
    """

    grid_map: GridMap
    height_layer: str
    flat: bool = False
    max_drawn_cells: int = 0

    def __post_init__(self) -> None:
        check_max_drawn_cells(self.max_drawn_cells)

    def values(self, layer: str) -> Layer:
        """Return the values (columns, rows) of a layer in the shown cells."""
        values = self.grid_map.unwrapped(layer).T
        if self._step == 1:
            return values
        rows, columns = self._kept
        return values[np.ix_(columns, rows)]

    @cached_property
    def valid(self) -> Mask:
        """Mask (columns, rows) of the shown cells with a finite height."""
        return np.isfinite(self.values(self.height_layer))

    @cached_property
    def triangles(self) -> npt.NDArray[np.int64]:
        """Corner cells (T, 3) of each triangle; counter-clockwise, seen from above."""
        columns, rows = self.valid.shape
        if rows < 2 or columns < 2:
            return np.empty((0, 3), np.int64)
        found = _triangles(self.valid, self.values(self.height_layer))
        kinds = [(np.flatnonzero(mask), corners) for mask, corners in found]
        ends = np.cumsum([0, *(len(first) for first, _ in kinds)])
        triangles = np.empty((ends[-1], 3), np.int64)
        for (first, corners), (begin, end) in zip(kinds, pairwise(ends), strict=True):
            for corner, offset in enumerate(corners):
                np.add(first, offset, out=triangles[begin:end, corner])
        return triangles

    def points(
        self, origin: npt.ArrayLike = (0.0, 0.0), dtype: npt.DTypeLike = np.float64
    ) -> npt.NDArray[Any]:
        """Return the shown cells as points (columns * rows, 3) [m], relative to `origin` (x, y)."""
        (x, y), (x0, y0) = self.grid_map.geometry.axes_in_map_order(), np.asarray(origin)
        if self._step > 1:
            rows, columns = self._kept
            x, y = x[rows], y[columns]
        heights = self.values(self.height_layer)
        points = np.empty((*heights.shape, 3), dtype)
        points[..., 0] = x - x0
        points[..., 1] = (y - y0)[:, None]
        points[..., 2] = 0.0 if self.flat else heights
        return points.reshape(-1, 3)

    def colors(self, coloring: Coloring) -> Colors:
        """Return the colors (columns * rows, 3) of all shown cells as red, green and blue.

        If the coloring has no layer, the heights determine the colors.
        """
        layer = "" if coloring.mode == "flat" else coloring.layer
        if coloring.mode == "intensity" and self._step > 1:
            lower, upper = self.bounds(coloring)
            if lower < upper:
                coloring = replace(coloring, lower=lower, upper=upper)
        return coloring(self.values(layer or self.height_layer)).reshape(-1, 3)

    def bounds(self, coloring: Coloring) -> tuple[float, float]:
        """Return the values at the ends of the color map, computed from all cells of the map."""
        return coloring.bounds(self.grid_map[coloring.layer or self.height_layer])

    def mesh(self, coloring: Coloring) -> Mesh:
        """Return the surface as a colored triangle mesh."""
        origin = self.grid_map.position
        valid = self.valid.ravel()
        # Omit vertices that are not finite, because graphics libraries reject them.
        numbers = np.cumsum(valid, dtype=np.uint32) - np.uint32(1)
        return Mesh(
            np.append(origin, 0.0),
            self.points(origin, np.float32)[valid],
            np.take(numbers, self.triangles),
            self.colors(coloring)[valid],
        )

    @cached_property
    def _step(self) -> int:
        (rows, columns), most = self.grid_map.size, self.max_drawn_cells
        if most == 0 or rows * columns <= most:
            return 1

        def lines(cells: int, step: int) -> int:
            # Every n-th line and up to two border lines are kept.
            return min(cells, -(-cells // step) + 2)

        return next(n for n in count(2) if lines(rows, n) * lines(columns, n) <= most)

    @cached_property
    def _kept(self) -> list[npt.NDArray[np.int64]]:
        """Indices of the shown rows and columns, in map order."""
        kept = []
        for axis in self.grid_map.geometry.axes_in_map_order():
            # The quotient is usually a whole or half number; adding 1/4 guards against rounding.
            first = int(np.floor(axis[0] / self.grid_map.resolution + 0.25))
            stays = (first - np.arange(len(axis))) % self._step == 0
            stays[[0, -1]] = True
            kept.append(np.flatnonzero(stays))
        return kept


def _triangles(valid: Mask, heights: Layer) -> Iterator[tuple[Mask, tuple[int, int, int]]]:
    """Yield (mask, offsets) for each of four groups of triangles.

    All triangles of a group omit the same corner of a square of four cells. `mask` (flattened)
    marks the first cells of the squares. The index of a first cell plus `offsets` gives the three
    corners of the triangle.
    """
    rows = valid.shape[1]
    is_first = np.ones(valid.shape, np.bool_)
    is_first[:, -1] = False
    # Cells of a square: first cell, next row (-x), next column (-y), next row and column.
    offsets = (0, 1, rows, rows + 1)
    squares = valid.size - offsets[-1]
    inside = is_first.ravel()[:squares]

    def corners(values: npt.NDArray[Any]) -> list[npt.NDArray[Any]]:
        flat = values.ravel()
        return [flat[offset : squares + offset] for offset in offsets]

    first, row, column, both = corners(heights)
    with np.errstate(invalid="ignore", over="ignore"):
        usual, other = np.abs(row - column), np.abs(first - both)
        turned = other < usual
        turned |= (other == usual) & (first + both > row + column)
    first, row, column, both = corners(valid)
    turned &= first & both
    kept = inside & row & column & ~turned
    yield kept & first, (0, 1, rows)
    yield kept & both, (1, rows + 1, rows)
    # Use the other diagonal if it has a smaller height difference, or if this one ends in a hole.
    crossed = inside & first & both
    yield crossed & column & (turned | ~row), (0, rows + 1, rows)
    yield crossed & row & (turned | ~column), (0, 1, rows + 1)
