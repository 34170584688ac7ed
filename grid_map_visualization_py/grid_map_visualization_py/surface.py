# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps as surfaces of triangles, for markers and for meshes.

Three cells of a square of four neighbors make a triangle if all three have a height: a square with
four heights is two triangles, one with three is one, and with fewer it is a hole. The corners of
the triangles are the centers of the cells.

Maps with more than `max_cells` cells are thinned out to every n-th row and column, and the first
and the last ones, so that the surface reaches as far as the map. Values are those of the cells that
stay, not means. Which rows and columns these are depends on where they lie in the frame of the map,
not on the map: the surface of a map that moves does not flicker.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import count, pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Layer, Mask, Positions
from grid_map_core_py.plugins import check

from .colors import Coloring, Colors

__all__ = ["SMALLEST_MAX_CELLS", "Mesh", "Surface", "check_max_cells"]

SMALLEST_MAX_CELLS = 9
"""A map cannot be thinned out to fewer cells: first, last and one in between, both ways."""


def check_max_cells(max_cells: int) -> None:
    """Raise `ConfigError` unless maps can be thinned out to so many cells, or 0 for never."""
    sensible = max_cells == 0 or max_cells >= SMALLEST_MAX_CELLS
    expected = f"0 (never thin out) or at least {SMALLEST_MAX_CELLS}"
    check(sensible, "max_cells", expected, max_cells)


@dataclass(frozen=True)
class Mesh:
    """Triangles that share their corners.

    Attributes:
        origin: (3,) where the vertices count from: the center of the map at height zero [m], map
            frame.
        vertices: (N, 3) float32 x, y, z from there [m], all finite.
        faces: (M, 3) uint32 numbers of vertices; counter-clockwise, seen from above.
        colors: (N, 3) uint8 red, green, blue of the vertices.
    """

    origin: Positions
    vertices: npt.NDArray[np.float32]
    faces: npt.NDArray[np.uint32]
    colors: Colors


@dataclass(frozen=True, eq=False)
class Surface:
    """The cells of a map that a surface shows, and the triangles between them.

    The arrays are transposed layers in map order: column after column, as the cells lie in memory.
    A cell's number is its place in that order.

    Args:
        grid_map: the map.
        height_layer: heights [m]; cells without a finite one are holes.
        flat: draw all at height zero, holes all the same.
        max_cells: thin out larger maps, see above; 0 for never, else at least
            `SMALLEST_MAX_CELLS`.

    Raises:
        LayerNotFoundError: the map lacks the layer.
        ConfigError: no map can be thinned out to so few cells.
    """

    grid_map: GridMap
    height_layer: str
    flat: bool = False
    max_cells: int = 0

    def __post_init__(self) -> None:
        check_max_cells(self.max_cells)

    def values(self, layer: str) -> Layer:
        """Return a layer (columns, rows) of the cells that are shown.

        Raises:
            LayerNotFoundError: the map lacks the layer.
        """
        values = self.grid_map.unwrapped(layer).T
        if self._step == 1:
            return values
        rows, columns = self._kept
        return values[np.ix_(columns, rows)]

    @cached_property
    def valid(self) -> Mask:
        """Mask (columns, rows) of the cells with a finite height."""
        return np.isfinite(self.values(self.height_layer))

    @cached_property
    def triangles(self) -> npt.NDArray[np.int64]:
        """Numbers (T, 3) of the corner cells; counter-clockwise, seen from above."""
        columns, rows = self.valid.shape
        if rows < 2 or columns < 2:
            return np.empty((0, 3), np.int64)
        kinds = [(np.flatnonzero(mask), corners) for mask, corners in _triangles(self.valid)]
        ends = np.cumsum([0, *(len(first) for first, _ in kinds)])
        triangles = np.empty((ends[-1], 3), np.int64)
        for (first, corners), (begin, end) in zip(kinds, pairwise(ends), strict=True):
            for corner, offset in enumerate(corners):
                np.add(first, offset, out=triangles[begin:end, corner])
        return triangles

    def points(
        self, origin: npt.ArrayLike = (0.0, 0.0), dtype: npt.DTypeLike = np.float64
    ) -> npt.NDArray[Any]:
        """Return x, y, z (columns * rows, 3) of all cells [m], x and y counted from `origin`."""
        (x, y), (x0, y0) = self._axes, np.asarray(origin)
        heights = self.values(self.height_layer)
        points = np.empty((*heights.shape, 3), dtype)
        points[..., 0] = x - x0
        points[..., 1] = (y - y0)[:, None]
        points[..., 2] = 0.0 if self.flat else heights
        return points.reshape(-1, 3)

    def colors(self, coloring: Coloring) -> Colors:
        """Return red, green, blue (columns * rows, 3) of all cells.

        Without a layer, the colors come from the heights. One color for all needs no layer.

        Raises:
            LayerNotFoundError: the map lacks the layer.
        """
        layer = "" if coloring.mode == "flat" else coloring.layer
        return coloring(self.values(layer or self.height_layer)).reshape(-1, 3)

    def mesh(self, coloring: Coloring) -> Mesh:
        """Return the surface as a mesh.

        Raises:
            LayerNotFoundError: the map lacks the layer of the colors.
        """
        origin = self.grid_map.position
        valid = self.valid.ravel()
        # Graphics libraries stumble over vertices that are not finite.
        numbers = np.cumsum(valid, dtype=np.uint32) - np.uint32(1)
        return Mesh(
            np.append(origin, 0.0),
            self.points(origin, np.float32)[valid],
            np.take(numbers, self.triangles),
            self.colors(coloring)[valid],
        )

    @cached_property
    def _step(self) -> int:
        rows, columns = self.grid_map.size
        if self.max_cells == 0 or rows * columns <= self.max_cells:
            return 1
        # At most so many lines stay: every n-th, and two borders.
        return next(n for n in count(2) if _lines(rows, n) * _lines(columns, n) <= self.max_cells)

    @cached_property
    def _kept(self) -> list[npt.NDArray[np.int64]]:
        """Rows and columns, in map order, of the cells that are shown."""
        resolution = self.grid_map.resolution
        return [
            _every(self._step, axis, resolution)
            for axis in self.grid_map.geometry.axes_in_map_order()
        ]

    @cached_property
    def _axes(self) -> tuple[Positions, Positions]:
        """Return x of the rows and y of the columns that are shown [m]."""
        axes = self.grid_map.geometry.axes_in_map_order()
        if self._step == 1:
            return axes
        rows, columns = self._kept
        return axes[0][rows], axes[1][columns]


def _triangles(valid: Mask) -> Iterator[tuple[Mask, tuple[int, int, int]]]:
    """Yield the squares of a kind of triangle, and where its corners lie from a square's cell 0."""
    rows = valid.shape[1]
    is_first = np.ones(valid.shape, np.bool_)
    is_first[:, -1] = False
    # Every square by its four cells: the first, the next row (-x), the next column (-y), both.
    offsets = (0, 1, rows, rows + 1)
    squares = valid.size - offsets[-1]
    flat = valid.ravel()
    first, row, column, both = (flat[offset : squares + offset] for offset in offsets)
    inside = is_first.ravel()[:squares]
    yield inside & first & row & column, (0, 1, rows)
    yield inside & row & both & column, (1, rows + 1, rows)
    # The two of the other diagonal, where the diagonal above is cut.
    yield inside & first & both & column & ~row, (0, rows + 1, rows)
    yield inside & first & row & both & ~column, (0, 1, rows + 1)


def _lines(cells: int, step: int) -> int:
    return min(cells, -(-cells // step) + 2)


def _every(step: int, axis: Positions, resolution: float) -> npt.NDArray[np.int64]:
    """Return which cells of an axis stay: every n-th of the frame, the first and the last."""
    # The quarter keeps centers at whole and half cells, the usual ones, clear of rounding.
    first = int(np.floor(axis[0] / resolution + 0.25))
    kept = (first - np.arange(len(axis))) % step == 0
    kept[[0, -1]] = True
    return np.flatnonzero(kept)
