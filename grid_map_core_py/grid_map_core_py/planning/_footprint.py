# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of robots, and the cells that they touch."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Mask, Positions, as_finite
from .._arrays._pieces import slices
from ..errors import GeometryError, short
from ..limits import check_cells
from ..map._axis import BORDER_TOLERANCE
from ..regions import Polygon

_CIRCLE_CORNERS = 32
_WIDTH = 1e-6  # least width of a footprint [m]


class Footprint:
    """Outline of a robot on the ground; immutable.

    The robot's origin need not be inside.

    Args:
        points: (N, 2) corners x, y [m] in the robot's frame (x forward, y to the left), in order
            along the outline; convex or not.

    Raises:
        GeometryError: fewer than three corners, edges that cross, a width below about 1e-6 m, or
            numbers that are not finite.

    Example:
        >>> Footprint.rectangle(0.9, 0.5).points.tolist()
        [[0.45, 0.25], [-0.45, 0.25], [-0.45, -0.25], [0.45, -0.25]]
    """

    __slots__ = ("_polygon",)

    def __init__(self, points: Polygon | ArrayLike) -> None:
        self._polygon = Polygon.of(points)
        perimeter = np.hypot(*(self.points - np.roll(self.points, 1, axis=0)).T).sum()
        # A narrower footprint on the border of a cell would touch no cell.
        least = _WIDTH / 2.0 * perimeter
        if len(self.points) < 3 or not self._polygon.area > least or _cross_each_other(self.points):
            expected = "at least 3 corners in order along an outline that does not cross itself"
            expected += f" and is at least {_WIDTH:g} m wide"
            raise GeometryError(f"points: expected {expected}, got {short(points)}")

    @classmethod
    def circle(cls, radius: float) -> Footprint:
        """Return a polygon of 32 corners around a circle.

        Args:
            radius: radius of the circle around the origin [m].
        """
        outer = as_finite(radius, "radius", "a positive number", above=0.0)
        outer /= math.cos(math.pi / _CIRCLE_CORNERS)
        angles = 2.0 * math.pi * np.arange(_CIRCLE_CORNERS) / _CIRCLE_CORNERS
        return cls(outer * np.stack([np.cos(angles), np.sin(angles)], axis=1))

    @classmethod
    def rectangle(cls, length: float, width: float) -> Footprint:
        """Return a rectangle around the origin.

        Args:
            length, width: sides along x and y [m].
        """
        x = 0.5 * as_finite(length, "length", "a positive number", above=0.0)
        y = 0.5 * as_finite(width, "width", "a positive number", above=0.0)
        return cls([(x, y), (-x, y), (-x, -y), (x, -y)])

    @property
    def points(self) -> Positions:
        """(N, 2) corners x, y [m], robot's frame; read-only."""
        return self._polygon.vertices

    @property
    def radius(self) -> float:
        """Distance from the origin to the farthest corner [m]."""
        return float(np.hypot(*self.points.T).max())

    def __repr__(self) -> str:
        return f"Footprint({self.points.tolist()})"


def touched_cells(
    footprint: Footprint, resolution: float, origins: Positions, yaws: Positions
) -> tuple[Integers, Integers, Integers]:
    """Return the cells whose square the footprint touches at each pose.

    A cell is touched if an edge leads through its square, or if its center is inside the footprint.
    Squares that share only their border with the footprint (up to 1e-9 m) are omitted.

    Args:
        resolution: side of a cell [m].
        origins: (P, 2) position of the footprint's origin, in rows and columns from the corner of
            the map with the largest x and y: cell (0, 0) is the square from (0, 0) to (1, 1).
        yaws: (P,) direction of the footprint's x axis, counter-clockwise from the map's x axis.

    Returns:
        pose, row, column: (N,) number of the pose and cell, which may be beyond the map; ordered.

    Raises:
        LimitError: the footprint is larger than the largest permitted map.
    """
    side = 2.0 * (footprint.radius / resolution + 1.0)
    check_cells("footprint", (side, side))
    tolerance = BORDER_TOLERANCE / resolution
    (x, y), cosine, sine = footprint.points.T / resolution, np.cos(yaws), np.sin(yaws)
    u = origins[:, 0] - (np.outer(x, cosine) - np.outer(y, sine))
    v = origins[:, 1] - (np.outer(x, sine) + np.outer(y, cosine))
    top, left = np.floor(u.min(axis=0) + tolerance), np.floor(v.min(axis=0) + tolerance)
    rows = np.arange(np.ceil(u.max(axis=0) - top - tolerance).max())
    width = int(np.ceil(v.max(axis=0) - left - tolerance).max())
    # From here on, the axes are edges, poses and rows.
    u0, v0 = (u - top)[..., np.newaxis], (v - left)[..., np.newaxis]
    u1, v1 = np.roll(u0, -1, axis=0), np.roll(v0, -1, axis=0)

    def columns_at(row: Positions) -> Positions:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(v0 + (v1 - v0) * np.clip((row - u0) / (u1 - u0), 0.0, 1.0))

    upper, middle, lower = rows + tolerance, rows + 0.5, rows + (1.0 - tolerance)
    begin, end = columns_at(upper), columns_at(lower)
    hits = (np.maximum(u0, u1) > upper) & (np.minimum(u0, u1) < lower)
    first, stop = np.minimum(begin, end) + tolerance, np.ceil(np.maximum(begin, end) - tolerance)
    crosses = (u0 > middle) != (u1 > middle)
    crossing = np.ceil(columns_at(middle) - 0.5)
    shape = len(yaws), len(rows), width + 1
    line = np.arange(shape[0] * shape[1]).reshape(shape[:2]) * shape[2]

    def counts(columns: Positions, counted: Mask) -> Integers:
        """Return how many of the counted edges have each of the cells as their column."""
        places = np.broadcast_to(line, columns.shape)[counted] + columns[counted].astype(np.int64)
        return np.bincount(places, minlength=math.prod(shape))

    # In each row, as many runs end as begin, and the number of crossings is even.
    is_on_edge = np.cumsum(counts(first, hits) - counts(stop, hits)) > 0
    is_inside = np.cumsum(counts(crossing, crosses)) % 2 == 1
    pose, row, column = np.nonzero((is_on_edge | is_inside).reshape(shape))
    return pose, row + top.astype(np.int64)[pose], column + left.astype(np.int64)[pose]


def batches(footprint: Footprint, resolution: float, count: int) -> Iterator[slice]:
    """Yield slices of `count` poses, so small that the cells under them fit into the cache."""
    side = 2.0 * (footprint.radius / resolution + 1.0)
    return slices(count, int(2**14 // side**2))


def kernel_of(footprint: Footprint, resolution: float, yaw: float) -> NDArray[np.uint8]:
    """Return the cells that a footprint touches around the cell at whose center it stands.

    Returns:
        (2 c + 1, 2 r + 1), transposed like an image of the map; the middle is the cell.
    """
    _, row, column = touched_cells(footprint, resolution, np.full((1, 2), 0.5), np.array([yaw]))
    rows, columns = (int(np.abs(lines).max(initial=0)) for lines in (row, column))
    kernel = np.zeros((2 * columns + 1, 2 * rows + 1), np.uint8)
    kernel[column + columns, row + rows] = 1
    return kernel


def _cross_each_other(corners: Positions) -> bool:
    """Return whether two edges of a polygon cross at an inner point of both."""
    begin = corners[:, np.newaxis]
    x, y = np.moveaxis(np.roll(begin, -1, axis=0) - begin, -1, 0)
    # (V, V): on which side of the line through an edge each corner is.
    side = np.sign(x * (corners - begin)[..., 1] - y * (corners - begin)[..., 0])
    parts = side * np.roll(side, -1, axis=1) < 0
    return bool((parts & parts.T).any())
