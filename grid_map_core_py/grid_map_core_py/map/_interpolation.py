# SPDX-License-Identifier: BSD-3-Clause
"""Interpolation of a layer between the centers of its cells.

All methods except `NEAREST` are separable: the value is a weighted sum of nearby cells, and each
weight is the product of a row weight and a column weight. Near the map border, the border cell
replaces missing neighbors.
"""

from __future__ import annotations

import math
from enum import Enum
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Layer, Pair, Positions, Size, as_positions, plain_pair
from .._arrays._pieces import CHUNK, slices
from ..errors import GridMapError, OutOfMapError, short
from ._axis import Axis, Coordinate
from ._geometry import GridGeometry

if TYPE_CHECKING:
    from ._grid_map import GridMap

Places: TypeAlias = NDArray[np.intp]

_PADDING = 2  # number of times that the border cell is repeated beyond each end of an axis

REACH = 3
"""Largest distance [cells] between a position's cell and the cells that affect the value there."""


class Interpolation(Enum):
    """Interpolation methods between cell centers, in order of increasing cost."""

    NEAREST = "nearest"
    """Value of the cell that contains the position."""

    LINEAR = "linear"
    """Bilinear between the 4 nearest cell centers."""

    CUBIC_CONVOLUTION = "cubic_convolution"
    """Cubic convolution over 4 x 4 cells with a = -1/2 (R. Keys, 1981)."""

    CUBIC = "cubic"
    """Bicubic Hermite polynomial between the 4 nearest cell centers.

    The slopes are central differences. The result differs from `CUBIC_CONVOLUTION` only within half
    a cell of the border, because the slope at the border cell continues beyond the border.
    """


_FALLBACKS = {
    Interpolation.LINEAR: Interpolation.NEAREST,
    Interpolation.CUBIC_CONVOLUTION: Interpolation.LINEAR,
    Interpolation.CUBIC: Interpolation.LINEAR,
}
"""For each method, the simpler method that is used where a cell that it needs is not finite."""


def interpolate(
    grid_map: GridMap, layer: str, positions: ArrayLike, interpolation: Interpolation | str
) -> float | Positions:
    method = interpolation if type(interpolation) is Interpolation else method_of(interpolation)
    grid = grid_map.geometry, grid_map.start_index, grid_map[layer]
    point = plain_pair(positions)
    if point is not None:
        return _value(*grid, point, method)
    positions = as_positions(positions)
    values = Surface(*grid).at(positions.reshape(-1, 2), method)
    return float(values[0]) if positions.ndim == 1 else values.reshape(positions.shape[:-1])


def method_of(interpolation: object) -> Interpolation:
    try:
        return Interpolation(interpolation)
    except ValueError:
        known = ", ".join(method.value for method in Interpolation)
        raise GridMapError(
            f"interpolation: expected one of {known}, got {short(interpolation)}"
        ) from None


def _value(
    geometry: GridGeometry, start: Size, layer: Layer, point: Pair, method: Interpolation
) -> float:
    """Return the value at one position, faster than `Surface.values`."""
    if method is Interpolation.NEAREST:
        cell = geometry.cell_at(point, start)
        if cell is None:
            raise _outside(geometry, point)
        return layer.item(cell)
    if not geometry.contains(point):
        raise _outside(geometry, point)
    reach, closed_above = _shape(method)
    rows = _neighbors(geometry._x, point[0], start[0], reach, closed_above)
    columns = _neighbors(geometry._y, point[1], start[1], reach, closed_above)
    item, value = layer.item, 0.0
    for column, column_weight in columns:
        part = 0.0
        for row, weight in rows:
            part += item(row, column) * weight
        value += part * column_weight
    if math.isfinite(value):
        return value
    return _value(geometry, start, layer, point, _FALLBACKS[method])


def _outside(geometry: GridGeometry, point: object) -> OutOfMapError:
    return OutOfMapError(f"position {point} is outside the map: {geometry.place}")


def check_inside(geometry: GridGeometry, points: Positions) -> None:
    if not len(points):
        return
    # Rounding preserves the order: if the extreme positions are inside, all positions are.
    lowest, highest = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    if not (geometry.contains(lowest) and geometry.contains(highest)):
        outside = points[~geometry.is_inside(points)][0]
        raise _outside(geometry, str(tuple(outside.tolist())))


class Surface:
    """Interpolated layer, evaluated at coordinates (2, N): a row of x and a row of y.

    If `corner` is not (0, 0), `layer` is a block in map order that begins at the map cell `corner`.
    """

    def __init__(
        self, geometry: GridGeometry, start: Size, layer: Layer, corner: Size = (0, 0)
    ) -> None:
        self._geometry = geometry
        self._start = start
        self._layer = layer
        self._corner = corner

    def at(self, points: Positions, method: Interpolation) -> Positions:
        """Return the values (N,) at positions (N, 2). Raises `OutOfMapError` outside the map."""
        values = np.empty(len(points))
        # Infinity times a weight of 0 is NaN. The values are then computed with a simpler method.
        with np.errstate(invalid="ignore"):
            for part in slices(len(points), CHUNK):
                check_inside(self._geometry, points[part])
                values[part] = self.values(np.ascontiguousarray(points[part].T), method)
        return values

    def values(self, xy: Positions, method: Interpolation) -> NDArray[np.floating[Any]]:
        """Return the values (N,) at coordinates (2, N) on the map."""
        if method is Interpolation.NEAREST:
            rows, columns = self._geometry._both.steps(xy).astype(np.intp)
            of_rows, of_columns = self._places
            places = of_rows[_PADDING:].take(rows, mode="clip")
            places += of_columns[_PADDING:].take(columns, mode="clip")
            nearest: NDArray[np.float32] = self._data.take(places, mode="clip")
            return nearest
        values = self._weighted_sums(xy, method)
        missing = np.flatnonzero(~np.isfinite(values))
        if missing.size:
            rest = xy.take(missing, axis=1)
            values[missing] = self.values(rest, _FALLBACKS[method])
        return values

    def _weighted_sums(self, xy: Positions, method: Interpolation) -> Positions:
        reach, closed_above = _shape(method)
        below, t = self._geometry._both.between(xy, closed_above)
        below = below.astype(np.intp)
        weights = np.array(_weights(t, reach))
        if closed_above:
            # Beyond the border, the slope of the border cell continues.
            size = np.array(self._geometry.size)[:, np.newaxis]
            for beyond, near, far in ((below >= size, 0, 3), (below <= 0, 3, 0)):
                if beyond.any():
                    weights[far][beyond], weights[near][beyond] = _continued(
                        weights[far][beyond], weights[near][beyond]
                    )
        # Half of the neighbors along an axis are below each position.
        rows, columns = offsets = np.empty((2, reach, xy.shape[1]), np.intp)
        for known, numbers, outs in zip(self._places, below, offsets, strict=True):
            for step, out in enumerate(outs, start=1 - reach // 2):
                known[_PADDING - step :].take(numbers, mode="clip", out=out)
        cells = self._data.take(rows + columns[:, np.newaxis], mode="clip")
        # `einsum` may fuse products and sums, and its result could then differ from `_value`.
        sums = np.multiply(cells, weights[:, 0]).sum(axis=1, initial=0.0)
        sums *= weights[:, 1]
        values: Positions = sums.sum(axis=0, initial=0.0)
        return values

    @property
    def _data(self) -> Layer:
        return self._layer.ravel(order="F")

    @property
    def _places(self) -> tuple[Places, Places]:
        (rows, columns), (row, column) = self._geometry.size, self._start
        stride = self._layer.shape[0]
        places = _places(rows, row, 1), _places(columns, column, stride)
        if self._corner == (0, 0):
            return places
        return places[0] - self._corner[0], places[1] - self._corner[1] * stride


def _shape(method: Interpolation) -> tuple[int, bool]:
    """Return the number of cells along an axis, and `closed_above` of `Axis.between`."""
    # At a cell center, `CUBIC` uses the interval below the center, as in C++.
    return (2 if method is Interpolation.LINEAR else 4), method is Interpolation.CUBIC


def _neighbors(
    axis: Axis, x: float, start: int, reach: int, closed_above: bool
) -> list[tuple[int, float]]:
    """Return (buffer index, weight) of the rows or columns near `x`, lowest coordinate first."""
    size = axis.size
    below, t = axis.between(x, closed_above, math)
    weights = _weights(t, reach)
    if closed_above and not 0 < below < size:
        lowest, low, high, highest = weights
        if below >= size:
            highest, lowest = _continued(highest, lowest)
        else:
            lowest, highest = _continued(lowest, highest)
        weights = lowest, low, high, highest
    first = max(below, 0) + reach // 2 - 1
    if reach <= first + 1 <= size:
        first += start
        return [((first - step) % size, weight) for step, weight in enumerate(weights)]
    # As in `_places`, the border cell is repeated beyond the map.
    cells = [min(max(first - step, 0), size - 1) for step in range(reach)]
    return [((cell + start) % size, weight) for cell, weight in zip(cells, weights, strict=True)]


def _weights(t: Coordinate, reach: int) -> tuple[Coordinate, ...]:
    """Return the weights (...) of 2 (linear) or 4 (cubic) neighbors, lowest coordinate first.

    `t` (...) is the position between the two inner cells, from 0 (lower) to 1 (upper).
    """
    rest = 1.0 - t
    if reach == 2:
        return rest, t
    # Keys's kernel with a = -1/2 equals the Hermite polynomial whose slopes are central
    # differences.
    outer = -0.5 * t
    outer *= rest
    lowest, highest = outer * rest, outer * t
    # With these inner weights, linear functions are reproduced exactly.
    bend = highest - lowest
    rest -= lowest
    rest += bend
    return lowest, rest, t - highest - bend, highest


def _continued(far: Coordinate, near: Coordinate) -> tuple[Coordinate, Coordinate]:
    """Return the weights of outer cells on and off the map, so that the border slope continues."""
    return far - near, 2.0 * near


@lru_cache(maxsize=8)
def _places(count: int, start: int, stride: int) -> Places:
    """Return the buffer offsets of cells -2 to `count` + 1, with the border cells repeated."""
    cells = np.arange(-_PADDING, count + _PADDING).clip(0, count - 1)
    return (cells + start) % count * stride
