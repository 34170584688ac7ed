# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of robots, and the cells that they touch.

Coordinates are in cells here: a row coordinate u and a column coordinate v, counted from the corner
of the map with the largest x and y. Cell (r, c) is the square r <= u <= r + 1, c <= v <= c + 1.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Mask, Positions, Size, as_finite
from .._arrays._pieces import PIECE, expanded, slices
from ..errors import GeometryError, short
from ..limits import check_cells
from ..map._axis import BORDER_TOLERANCE
from ..regions import Polygon

_CIRCLE_CORNERS = 32


class Footprint:
    """Outline of a robot on the ground; immutable.

    The robot's origin need not be inside. Repeated corners are omitted.

    Args:
        points: (N, 2) corners x, y [m] in the robot's frame (x forward, y to the left), in order
            along the outline; convex or not. A `Polygon` is accepted as well.

    Raises:
        GeometryError: fewer than three corners, edges that cross, no area, or numbers that are not
            finite.

    Example:
        >>> Footprint.rectangle(0.9, 0.5).points.tolist()
        [[0.45, 0.25], [-0.45, 0.25], [-0.45, -0.25], [0.45, -0.25]]
    """

    __slots__ = ("_is_convex", "_polygon")

    def __init__(self, points: Polygon | ArrayLike) -> None:
        corners = Polygon.of(points).vertices
        corners = corners[(corners != np.roll(corners, -1, axis=0)).any(axis=1)]
        self._polygon = Polygon(corners)
        if len(corners) < 3 or not self._polygon.area > 0 or _cross_each_other(corners):
            expected = "at least 3 corners in order along an outline that does not cross itself"
            raise GeometryError(f"points: expected {expected}, got {short(points)}")
        ahead = np.roll(corners, -1, axis=0) - corners
        turns = _cross(ahead, np.roll(ahead, -1, axis=0))
        self._is_convex = bool((turns >= 0).all() or (turns <= 0).all())

    @classmethod
    def circle(cls, radius: float) -> Footprint:
        """Return a polygon of 32 corners around a circle.

        Args:
            radius: radius of the circle around the origin [m].
        """
        outer = _positive(radius, "radius") / math.cos(math.pi / _CIRCLE_CORNERS)
        angles = 2.0 * math.pi * np.arange(_CIRCLE_CORNERS) / _CIRCLE_CORNERS
        return cls(outer * np.stack([np.cos(angles), np.sin(angles)], axis=1))

    @classmethod
    def rectangle(cls, length: float, width: float) -> Footprint:
        """Return a rectangle around the origin.

        Args:
            length, width: sides along x and y [m].
        """
        x, y = 0.5 * _positive(length, "length"), 0.5 * _positive(width, "width")
        return cls([(x, y), (-x, y), (-x, -y), (x, -y)])

    @property
    def points(self) -> Positions:
        """(N, 2) corners x, y [m], robot's frame; read-only."""
        return self._polygon.vertices

    @property
    def radius(self) -> float:
        """Distance from the origin to the farthest corner [m]."""
        return float(np.hypot(*self.points.T).max())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Footprint) and self._polygon == other._polygon

    def __hash__(self) -> int:
        return hash(self._polygon)

    def __repr__(self) -> str:
        return f"Footprint({self.points.tolist()})"


class Runs(NamedTuple):
    """Runs of cells under footprints; the runs of one pose do not overlap.

    Attributes:
        pose: (M,) number of the pose.
        row: (M,) row of the run; it may be outside the map, as may the columns.
        first, stop: (M,) first column, and the column after the last.
    """

    pose: Integers
    row: Integers
    first: Integers
    stop: Integers


def touched_runs(
    footprint: Footprint, resolution: float, origins: Positions, yaws: Positions
) -> Runs:
    """Return the cells whose square the footprint touches, as runs, pose by pose.

    Cells that share only their border with the footprint (up to 1e-9 m) are omitted.

    Args:
        resolution: side of a cell [m].
        origins: (P, 2) coordinates u, v of the footprint's origin.
        yaws: (P,) direction of the footprint's x axis, counter-clockwise from the map's x axis.

    Raises:
        LimitError: the footprint is larger than the largest permitted map.
    """
    side = 2.0 * (footprint.radius / resolution + 1.0)
    check_cells("footprint", (side, side))
    x, y = footprint.points.T / resolution
    step = int(PIECE // (side * len(x)))
    parts = []
    for part in slices(len(yaws), step):
        cosine, sine = np.cos(yaws[part]), np.sin(yaws[part])
        u = origins[part, 0] - (np.outer(x, cosine) - np.outer(y, sine))
        v = origins[part, 1] - (np.outer(x, sine) + np.outer(y, cosine))
        pose, *runs = _runs(u, v, BORDER_TOLERANCE / resolution, footprint._is_convex)
        parts.append((pose + part.start, *runs))
    return Runs(*map(np.concatenate, zip(*parts, strict=True)))


def _runs(u: Positions, v: Positions, tolerance: float, is_convex: bool) -> tuple[Integers, ...]:
    """Return the runs under polygons with the corners u, v (V, P) [cells]."""
    top = np.floor(u.min(axis=0) + tolerance)
    bottom = np.ceil(u.max(axis=0) - tolerance)
    rows = top + np.arange((bottom - top).max())[:, None]
    # From here on, the axes are edges, rows and poses.
    u0, v0 = u[:, None], v[:, None]
    u1, v1 = np.roll(u0, -1, axis=0), np.roll(v0, -1, axis=0)
    along_u, along_v = u1 - u0, v1 - v0
    upper, lower = rows + tolerance, rows + (1.0 - tolerance)
    with np.errstate(divide="ignore", invalid="ignore"):
        begin = v0 + along_v * np.clip((upper - u0) / along_u, 0.0, 1.0)
        end = v0 + along_v * np.clip((lower - u0) / along_u, 0.0, 1.0)
    misses = (np.maximum(u0, u1) <= upper) | (np.minimum(u0, u1) >= lower)
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    low[misses], high[misses] = np.inf, -np.inf
    if is_convex:
        low, high = low.min(axis=0, keepdims=True), high.max(axis=0, keepdims=True)
    else:
        # Cells without a piece of an edge are inside if the middle of their row is.
        middle = rows + 0.5
        crosses = (u0 > middle) != (u1 > middle)
        with np.errstate(divide="ignore", invalid="ignore"):
            places = v0 + along_v * ((middle - u0) / along_u)
        places = np.sort(np.where(crosses, places, np.inf), axis=0)
        low = np.concatenate((low, places[:-1:2]))
        high = np.concatenate((high, places[1::2]))
    low[np.isinf(high)] = high[np.isinf(high)] = 0.0
    first, stop = np.floor(low + tolerance), np.ceil(high - tolerance)
    if not is_convex:
        first, stop = _without_overlaps(first, stop)
    pose, row, _ = kept = np.nonzero((stop > first).T)
    runs = (rows.T[pose, row], first.T[kept], stop.T[kept])
    return (pose, *(numbers.astype(np.int64) for numbers in runs))


def _without_overlaps(first: Positions, stop: Positions) -> tuple[Positions, Positions]:
    """Sort the runs along the first axis, and let each begin after the ends of those before."""
    order = np.argsort(first, axis=0)
    first, stop = (np.take_along_axis(columns, order, axis=0) for columns in (first, stop))
    first[1:] = np.maximum(first[1:], np.maximum.accumulate(stop, axis=0)[:-1])
    return first, stop


class Kernel(NamedTuple):
    """The cells that a footprint touches around the cell at whose center it stands.

    Attributes:
        element: (2 c + 1, 2 r + 1), transposed like an image of the map; the middle is the cell.
        is_whole: False if cells are missing because no map of the given size contains them.
    """

    element: NDArray[np.uint8]
    is_whole: bool


def kernels_of(
    footprint: Footprint, resolution: float, yaws: Sequence[float], size: Size
) -> tuple[list[Kernel], list[int]]:
    """Return the different kernels of a footprint, and the number of the kernel of each yaw.

    Args:
        resolution: side of a cell [m].
        yaws: directions of the footprint [rad].
        size: rows and columns of the map.
    """
    kernels: dict[Hashable, tuple[int, Kernel]] = {}
    numbers = []
    for yaw in yaws:
        kernel = _kernel(footprint, resolution, yaw, size)
        key = kernel.element.tobytes(), kernel.element.shape, kernel.is_whole
        number, _ = kernels.setdefault(key, (len(kernels), kernel))
        numbers.append(number)
    return [kernel for _, kernel in kernels.values()], numbers


def _kernel(footprint: Footprint, resolution: float, yaw: float, size: Size) -> Kernel:
    origin, direction = np.array([[0.5, 0.5]]), np.array([yaw])
    _, row, first, stop = touched_runs(footprint, resolution, origin, direction)
    rows = min(int(np.abs(row).max()), size[0] - 1)
    columns = min(int(np.maximum(np.abs(first), np.abs(stop - 1)).max()), size[1] - 1)
    run, offset = next(expanded(stop - first, int((stop - first).sum())))
    row, column = row[run], first[run] + offset
    inside = (np.abs(row) <= rows) & (np.abs(column) <= columns)
    element = np.zeros((2 * columns + 1, 2 * rows + 1), np.uint8)
    element[column[inside] + columns, row[inside] + rows] = 1
    return Kernel(element, bool(inside.all()))


def free_poses(
    free: Mask,
    footprint: Footprint,
    resolution: float,
    yaws: Sequence[float],
    *,
    outside_is_free: bool = False,
) -> Mask:
    """Return where the footprint, at the center of each cell, touches only free cells.

    Args:
        free: (rows, cols) bool in map order.
        resolution: side of a cell [m].
        yaws: directions of the footprint [rad].
        outside_is_free: whether the cells beyond the map are free.

    Returns:
        (rows, cols, len(yaws)) bool in Fortran order.
    """
    rows, columns = free.shape
    image = np.ascontiguousarray(free.T).view(np.uint8)
    kernels, numbers = kernels_of(footprint, resolution, yaws, (rows, columns))
    border: dict[str, Any] = {
        "borderType": cv2.BORDER_CONSTANT,
        "borderValue": float(outside_is_free),
    }
    found = [
        cv2.erode(image, element, **border).T if is_whole or outside_is_free else False
        for element, is_whole in kernels
    ]
    result = np.empty((rows, columns, len(numbers)), np.bool_, order="F")
    for place, number in enumerate(numbers):
        result[..., place] = found[number]
    return result


def _positive(value: float, name: str) -> float:
    return as_finite(value, name, "a positive number", above=0.0)


def _cross(a: Positions, b: Positions) -> Positions:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _cross_each_other(corners: Positions) -> bool:
    """Return whether two edges of a polygon cross at an inner point of both."""
    begin = corners[:, None]
    along = np.roll(begin, -1, axis=0) - begin
    # (V, V): on which side of the line through an edge each corner is.
    side = np.sign(_cross(along, corners - begin))
    parts = side * np.roll(side, -1, axis=1) < 0
    return bool((parts & parts.T).any())
