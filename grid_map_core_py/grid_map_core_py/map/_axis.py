# SPDX-License-Identifier: BSD-3-Clause
"""Conversion between coordinates and cells along x or y.

Cells are counted from the border with the largest coordinate, whatever the start index is.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Mask, Positions

Coordinate = TypeVar("Coordinate", float, NDArray[Any])
"""One coordinate [m] or an array of them; results for both are rounded in the same way."""

BORDER_TOLERANCE = 1e-9
"""Distance [m] within which the edge of a shape counts as lying on a cell border or center."""


class Axis:
    """Cells of a grid along x or y. Lengths and coordinates are in meters.

    In an axis from `both_axes`, all attributes except `resolution` are arrays.
    """

    __slots__ = ("center", "first", "half", "length", "resolution", "size")

    def __init__(self, size: int, resolution: float, center: float) -> None:
        self.size = size
        self.resolution = resolution
        self.center = center
        self.length = size * resolution
        self.half = 0.5 * self.length
        self.first = center + 0.5 * (self.length - resolution)  # center of cell 0

    def contains(self, x: Coordinate) -> bool | Mask:
        """Return whether coordinates are on the map, False for NaN.

        The border with the larger coordinate belongs to the map, and the other border does not.
        Coordinates near a border are rounded as in the C++ library.
        """
        offset = self.offset(x)
        return (offset >= 0.0) & (offset < self.length)

    def offset(self, x: Coordinate) -> Coordinate:
        """Return the distances [m] from the upper border, rounded as in `contains`."""
        return self.half - (x - self.center)

    def steps(self, x: Coordinate) -> Coordinate:
        """Return the distances from the upper border [cells]; rounding may leave the map."""
        steps = x - self.half
        steps -= self.center
        steps /= -self.resolution
        return steps

    @property
    def precision(self) -> float:
        """Spacing of floats at the magnitude of the largest coordinate [m]."""
        return math.ulp(abs(self.center) + self.length)

    @property
    def ends(self) -> tuple[float, float]:
        """Smallest and largest coordinate on the map [m], accurate to `precision`."""
        lower, upper, step = self.center - self.half, self.center + self.half, self.precision
        while not self.offset(lower) < self.length:
            lower += step
        while not self.offset(upper) >= 0.0:
            upper -= step
        return lower, upper

    def cell_at(self, x: float) -> int:
        """Return the cell of a coordinate on the map. A cell includes its upper border."""
        return min(max(int(self.steps(x)), 0), self.size - 1)

    def center_of(self, cell: Coordinate) -> Coordinate:
        return self.first - self.resolution * cell

    def centers(self, first: int, stop: int) -> Positions:
        # A range of floats saves the conversion from integers.
        return self.center_of(np.arange(first, stop, dtype=np.float64))

    def between(
        self, x: Coordinate, closed_above: bool, rounding: Any = np
    ) -> tuple[Any, Coordinate]:
        """Return the interval between cell centers that contains each coordinate.

        Args:
            closed_above: whether a coordinate exactly at a cell center belongs to the interval
                below the center (t = 1) or above it (t = 0).
            rounding: NumPy, or the module `math` for one coordinate.

        Returns:
            below: index of the cell at the lower end of the interval, from 0 to `size`. The cell at
                the upper end has the index `below` - 1. The indices -1 and `size` are just outside
                the map.
            t: position in the interval, from 0 (lower end) to 1.
        """
        cell = rounding.trunc(self.steps(x))
        # Rounded like the map's own cell centers, so that t is exactly 0 at a center.
        t = x - self.center_of(cell)
        t /= self.resolution
        above = rounding.ceil(t) - 1 if closed_above else rounding.floor(t)
        t -= above
        cell -= above
        return cell, t

    def overlapped(self, lower: float, upper: float) -> slice:
        """Return the cells that an interval overlaps by more than `BORDER_TOLERANCE`."""
        size, tolerance = self.size, BORDER_TOLERANCE / self.resolution
        near, far = self.steps(upper) + tolerance, self.steps(lower) - tolerance
        # `near` or `far` may be infinite. Comparisons are faster than `min` and `max`.
        if near >= size or (near < 0.0 and far <= 0.0):
            return slice(0, 0)
        first = int(near) if near > 0.0 else 0
        stop = size if far >= size else math.ceil(far)
        return slice(first, stop if stop > first else first + 1)

    def shift_to(self, center: float) -> float:
        """Return the distance to a center in whole cells, positive towards smaller coordinates."""
        cells = (self.center - center) / self.resolution
        return math.copysign((abs(cells) + 0.5) // 1.0, cells)

    def at(self, center: float) -> Axis:
        return Axis(self.size, self.resolution, center)

    def shifted(self, shift: int) -> Axis:
        """Return the axis moved by `shift` cells towards smaller coordinates."""
        return self.at(self.center - self.resolution * shift)

    def block(self, first: int, stop: int) -> Axis:
        size = stop - first
        corner = self.center + self.half
        center = corner - self.resolution * (first + 0.5 * size)
        return Axis(size, self.resolution, center)


def both_axes(x: Axis, y: Axis) -> Axis:
    """Combine the x and y axes into one `Axis` of (2, 1) arrays, for coordinates (2, N)."""
    size: Any = np.array([[x.size], [y.size]])
    center: Any = np.array([[x.center], [y.center]])
    return Axis(size, x.resolution, center)
