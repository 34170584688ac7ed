# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Interpolation of a layer between the centers of its cells.

All methods but `NEAREST` are separable: the value is a weighted sum over the cells in a few rows
and columns around the position, and the weight of a cell is that of its row times that of its
column. An axis therefore gives for every position the places of its cells in the buffer and their
weights; beyond the border it repeats the border cell.
"""

from __future__ import annotations

from enum import Enum
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays._checks import Layer, Positions, Size, as_positions, as_text
from ..arrays._pieces import CHUNK, slices
from ..errors import GridMapError, OutOfMapError, short
from ._geometry import GridGeometry

if TYPE_CHECKING:
    from ._grid_map import GridMap

Places: TypeAlias = NDArray[np.intp]

_PADDING = 2  # number of cells beyond the border that an axis repeats


class Interpolation(Enum):
    """Methods of interpolation between cell centers, in the order of increasing effort."""

    NEAREST = "nearest"
    """The value of the cell that contains the position."""

    LINEAR = "linear"
    """Bilinear between the 4 nearest cell centers."""

    CUBIC_CONVOLUTION = "cubic_convolution"
    """Cubic convolution over 4 x 4 cells; R. Keys, 1981, with a = -1/2."""

    CUBIC = "cubic"
    """Bicubic Hermite polynomial between the 4 nearest cell centers.

    Its slopes are central differences, at the border with the border cell repeated. It differs from
    `CUBIC_CONVOLUTION` only within half a cell of the border, where it goes on with these slopes.
    """


_FALLBACKS = {
    Interpolation.LINEAR: Interpolation.NEAREST,
    Interpolation.CUBIC_CONVOLUTION: Interpolation.LINEAR,
    Interpolation.CUBIC: Interpolation.LINEAR,
}
"""The simpler method that replaces each method at cells that are not finite."""


def interpolate(
    grid_map: GridMap, layer: str, positions: ArrayLike, interpolation: Interpolation | str
) -> float | Positions:
    """Return the values of a layer at positions, as `GridMap.at_position` describes them."""
    try:
        method = Interpolation(interpolation)
    except ValueError:
        known = ", ".join(method.value for method in Interpolation)
        raise GridMapError(
            f"interpolation: expected one of {known}, got {short(interpolation)}"
        ) from None
    surface = _Surface(grid_map.geometry, grid_map.start_index, grid_map[layer])
    positions = as_positions(positions)
    points = positions.reshape(-1, 2)
    values = np.empty(len(points))
    # An infinite cell with weight 0 gives NaN; the simpler method is then used.
    with np.errstate(invalid="ignore"):
        for part in slices(len(points), CHUNK):
            xy = surface.coordinates(points[part])
            values[part] = surface.values(xy, method)
    return float(values[0]) if positions.ndim == 1 else values.reshape(positions.shape[:-1])


class _Surface:
    """A layer as a function of coordinates (2, N): x in the first row, y in the second."""

    def __init__(self, geometry: GridGeometry, start: Size, layer: Layer) -> None:
        rows, columns = geometry.size
        self._geometry = geometry
        self._data = layer.ravel(order="F")
        self._places = _places(rows, start[0], 1), _places(columns, start[1], rows)
        self._center = geometry.position[:, np.newaxis]
        self._half = 0.5 * geometry.length[:, np.newaxis]
        # For single numbers Python is faster than NumPy.
        self._sides = list(zip(geometry.position.tolist(), geometry.length.tolist(), strict=True))

    def coordinates(self, points: Positions) -> Positions:
        """Return (N, 2) positions as coordinates (2, N); raise if one is not on the map."""
        xy = np.ascontiguousarray(points.T)
        # Rounding keeps the order: if the extremes are inside, all positions are.
        lowest, highest = xy.min(axis=1).tolist(), xy.max(axis=1).tolist()
        for low, high, (center, length) in zip(lowest, highest, self._sides, strict=True):
            half = 0.5 * length
            if not (half - (high - center) >= 0.0 and half - (low - center) < length):
                outside = points[~self._geometry.is_inside(points)][0]
                raise OutOfMapError(
                    f"position {as_text(outside)} is outside the map: {self._geometry.place}"
                )
        return xy

    def values(self, xy: Positions, method: Interpolation) -> NDArray[np.floating[Any]]:
        """Return the values (N,) at coordinates (2, N) on the map."""
        if method is Interpolation.NEAREST:
            rows, columns = self._cells(xy).astype(np.intp)
            places = self._places[0][_PADDING:].take(rows, mode="clip")
            places += self._places[1][_PADDING:].take(columns, mode="clip")
            nearest: NDArray[np.float32] = self._data.take(places, mode="clip")
            return nearest
        values = self._weighted_sums(xy, method)
        missing = np.flatnonzero(~np.isfinite(values))
        if missing.size:
            rest = xy.take(missing, axis=1)
            values[missing] = self.values(rest, _FALLBACKS[method])
        return values

    def _weighted_sums(self, xy: Positions, method: Interpolation) -> Positions:
        # As in C++, a position on a line of centers uses the cells on one side only.
        below, t = self._between(xy, closed_above=method is Interpolation.CUBIC)
        reach = 2 if method is Interpolation.LINEAR else 4
        weights = np.empty((reach, *t.shape))
        _set_weights(weights, t)
        if method is Interpolation.CUBIC:
            _continue_slopes(weights, below, self._geometry.size)
        # Half of the neighbors along an axis are below each position.
        rows, columns = offsets = np.empty((2, reach, xy.shape[1]), np.intp)
        for known, numbers, outs in zip(self._places, below, offsets, strict=True):
            for step, out in enumerate(outs, start=1 - reach // 2):
                known[_PADDING - step :].take(numbers, mode="clip", out=out)
        cells = self._data.take(rows + columns[:, np.newaxis], mode="clip")
        sums = np.einsum("crn,rn->cn", cells, weights[:, 0])
        values: Positions = np.einsum("cn,cn->n", sums, weights[:, 1])
        return values

    def _cells(self, xy: Positions) -> Positions:
        """Return (2, N) rows and columns from the corner, rounded as `GridGeometry` rounds them."""
        cells = xy - self._half
        cells -= self._center
        cells /= -self._geometry.resolution
        return cells

    def _between(self, xy: Positions, *, closed_above: bool) -> tuple[Places, Positions]:
        """Return the rows and columns of the cell centers beside coordinates (2, N).

        Args:
            closed_above: True if a coordinate on a center belongs to the interval below it, with
                t = 1, and not to the one above it, with t = 0.

        Returns:
            below: (2, N) row and column with the smaller coordinate, 0 ... count; the other ones
                have the number before.
            t: (2, N) place in between, from 0 at the smaller to 1 at the larger coordinate.
        """
        length, resolution = self._geometry.length[:, np.newaxis], self._geometry.resolution
        cells = self._cells(xy)
        np.trunc(cells, out=cells)
        # Rounded like the map's own cell centers, so that t is exactly 0 at a center.
        t = cells * -resolution
        t += self._center + 0.5 * (length - resolution)
        np.subtract(xy, t, out=t)
        t /= resolution
        above = np.ceil(t) - 1.0 if closed_above else np.floor(t)
        t -= above
        cells -= above
        return cells.astype(np.intp), t


def _set_weights(weights: Positions, t: Positions) -> None:
    """Set the weights (K, ...) of K neighbors in a row, the lowest one first.

    Args:
        weights: weights of 2 cells, linear, or of 4, cubic.
        t: (...) place between the two inner cells, from 0 at the lower to 1 at the higher.
    """
    rest = 1.0 - t
    if len(weights) == 2:
        weights[0], weights[1] = rest, t
        return
    # Keys's kernel with a = -1/2; the Hermite polynomial with central differences for slopes is
    # the same.
    lowest, below, above, highest = weights
    outer = -0.5 * t
    outer *= rest
    np.multiply(outer, rest, out=lowest)
    np.multiply(outer, t, out=highest)
    # With these inner weights, constants and straight lines are reproduced exactly.
    bend = np.subtract(highest, lowest, out=outer)
    np.subtract(rest, lowest, out=below)
    below += bend
    np.subtract(t, highest, out=above)
    above -= bend


def _continue_slopes(weights: Positions, below: Places, size: Size) -> None:
    """Give a corner beyond the border the slope of the border cell, in cubic weights (4, 2, N).

    If the border cell were only repeated, its slope would be zero.
    """
    for beyond, near, far in ((below >= np.array(size)[:, np.newaxis], 0, 3), (below <= 0, 3, 0)):
        if beyond.any():
            weights[far][beyond] -= weights[near][beyond]
            weights[near][beyond] *= 2.0


@lru_cache(maxsize=8)
def _places(count: int, start: int, stride: int) -> Places:
    """Return the places in the flat buffer of the cells -2 ... count + 1 of an axis.

    Beyond the map they repeat the border cell, which at the far border also serves positions that
    rounding takes one cell too far.
    """
    cells = np.arange(-_PADDING, count + _PADDING).clip(0, count - 1)
    return (cells + start) % count * stride
