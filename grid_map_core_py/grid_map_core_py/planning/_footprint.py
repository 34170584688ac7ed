# SPDX-License-Identifier: BSD-3-Clause
"""Outlines of robots, the cells that they touch, and values under them."""

from __future__ import annotations

import math
from ast import literal_eval
from collections.abc import Callable, Iterator
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Positions, as_finite
from .._arrays._pieces import slices
from .._parameters import mismatch
from ..errors import GeometryError, short
from ..limits import check_cells
from ..map._axis import BORDER_TOLERANCE
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..plugins import check
from ..regions import Polygon

_CIRCLE_CORNERS = 32
LEAST_WIDTH = 1e-6  # least width of a footprint [m]
_FAR = 2.0**30  # row or column that is beyond every map
_BATCH = 2**17  # edges times cells that are compared at once; they fit into the cache


class Footprint:
    """Outline of a robot on the ground; immutable.

    The outline may be concave. The origin of the robot's frame may be outside the outline.

    Args:
        points: (N, 2) corners x, y [m] in the robot's frame (x forward, y to the left), in order
            along the outline.

    Raises:
        GeometryError: there are fewer than three corners, edges cross, the outline is narrower than
            about 1e-6 m, or a number is not finite.

    Example:
        >>> Footprint.rectangle(0.9, 0.5).points.tolist()
        [[0.45, 0.25], [-0.45, 0.25], [-0.45, -0.25], [0.45, -0.25]]
    """

    __slots__ = ("_polygon",)

    def __init__(self, points: Polygon | ArrayLike) -> None:
        self._polygon = Polygon.of(points)
        begin = self.points[:, np.newaxis]
        x, y = edges = np.moveaxis(np.roll(begin, -1, axis=0) - begin, -1, 0)
        # (N, N): on which side of the line through an edge each corner is.
        side = np.sign(x * (self.points - begin)[..., 1] - y * (self.points - begin)[..., 0])
        parts = side * np.roll(side, -1, axis=1) < 0
        # A narrower footprint on the border of a cell would touch no cell.
        least = 0.5 * LEAST_WIDTH * np.hypot(*edges).sum()
        if len(begin) < 3 or not self._polygon.area > least or (parts & parts.T).any():
            expected = "at least 3 corners in order along an outline that does not cross itself"
            expected += f" and is at least {LEAST_WIDTH:g} m wide"
            raise GeometryError(f"points: expected {expected}, got {short(points)}")

    @classmethod
    def circle(cls, radius: float) -> Footprint:
        """Return a polygon with 32 corners that encloses a circle around the origin.

        Args:
            radius: radius of the circle [m], more than 1e-6.
        """
        outer = as_finite(radius, "radius", f"a length > {LEAST_WIDTH:g} [m]", above=LEAST_WIDTH)
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


def parsed_footprint(corners: Any) -> Footprint:
    """Return the footprint of a parameter `footprint`: a list of corners, or its text."""
    try:
        return Footprint(literal_eval(corners) if isinstance(corners, str) else corners)
    except (MemoryError, RecursionError, SyntaxError, TypeError, ValueError) as error:
        expected = "corners [x, y] [m] in order along an outline that does not cross itself"
        raise mismatch("footprint", expected, corners) from error


def touched_cells(
    footprint: Footprint, geometry: GridGeometry, poses: Positions
) -> Iterator[tuple[slice, Integers, Integers]]:
    """Yield the cells that a footprint touches at poses (P, 3), in batches of poses.

    A footprint touches a cell if an edge crosses the cell or if it contains the cell center.
    Contact at the border, up to 1e-9 m, does not count.

    Yields:
        batch: slice of the poses.
        pose: (N,) indices of the poses that touch the cells, counted within the batch, ascending.
        cells: (2, N) rows and columns in map order; cells may be outside the map.
    """
    check(isinstance(footprint, Footprint), "footprint", "a Footprint", footprint)
    side = 2.0 * (footprint.radius / geometry.resolution + 1.0)
    check_cells("footprint", (side, side))
    tolerance = BORDER_TOLERANCE / geometry.resolution
    corners = footprint.points @ [1.0, 1j] / geometry.resolution
    origins = ((geometry.corner - poses[:, :2]) / geometry.resolution).clip(-_FAR, _FAR)
    for batch in slices(len(poses), int(_BATCH / (len(corners) * side**2))):
        turned = np.outer(corners, np.exp(1j * poses[batch, 2]))
        u, v = origins[batch, 0] - turned.real, origins[batch, 1] - turned.imag
        top, left = np.floor(u.min(axis=0) + tolerance), np.floor(v.min(axis=0) + tolerance)
        # From here on, the axes are columns, edges, rows and poses; long inner loops are fast.
        u0, v0 = (u - top)[:, np.newaxis], (v - left)[:, np.newaxis]
        u1, v1 = np.roll(u0, -1, axis=0), np.roll(v0, -1, axis=0)
        rows = np.arange(np.ceil(u0.max() - tolerance))[:, np.newaxis]
        columns = np.arange(np.ceil(v0.max() - tolerance)).reshape(-1, 1, 1, 1)
        upper, middle, lower = levels = np.add.outer([tolerance, 0.5, 1.0 - tolerance], rows)
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = (levels[:, np.newaxis] - u0) / (u1 - u0)
        begin, center, end = v0 + (v1 - v0) * shares.clip(0.0, 1.0)
        in_row = (np.maximum(u0, u1) > upper) & (np.minimum(u0, u1) < lower)
        first = np.where(in_row, np.minimum(begin, end) - (1.0 - tolerance), np.inf)
        last = np.maximum(begin, end) - tolerance
        on_edge = ((first < columns) & (columns < last)).any(axis=1)
        inner = np.where((u0 > middle) != (u1 > middle), center - 0.5, np.inf)
        is_inside = np.logical_xor.reduce(inner <= columns, axis=1)
        pose, row, column = np.nonzero((on_edge | is_inside).T)
        yield batch, pose, np.stack([row + top[pose], column + left[pose]]).astype(np.int64)


def kernel_of(footprint: Footprint, resolution: float, yaw: float) -> NDArray[np.uint8]:
    """Return an odd-sized mask of the touched cells, centered on the origin of the footprint."""
    one_cell, pose = GridGeometry((resolution, resolution), resolution), np.array([[0.0, 0.0, yaw]])
    ((_, _, cells),) = touched_cells(footprint, one_cell, pose)
    reach = np.abs(cells).max(axis=1, keepdims=True, initial=0)
    kernel = np.zeros((2 * reach[:, 0] + 1).tolist(), np.uint8)
    kernel[tuple(cells + reach)] = 1
    return kernel


def footprint_layer(
    grid_map: GridMap,
    footprint: Footprint,
    layer: str,
    yaws: int = 16,
    statistic: Literal["min", "mean", "max"] = "min",
) -> NDArray[np.float32]:
    """Return a statistic of the values under the footprint, for every cell and several directions.

    A cell is unknown if it is outside the map or if its value is not finite.

    Args:
        layer: layer with the values.
        yaws: number of directions; the yaw of direction k is 2 pi k / `yaws`.
        statistic: lowest value, mean or highest value of the cells that the footprint touches.

    Returns:
        (rows, cols, yaws) float32 in buffer order: the statistic for a footprint at the center of
        each cell. NaN if a cell under the footprint is unknown.

    Raises:
        LayerNotFoundError: the layer does not exist.
        ConfigError: `yaws` or `statistic` is invalid.
        LimitError: the footprint is larger than the largest permitted map.

    Example:
        >>> grid_map = GridMap((2.0, 2.0), 0.1, layers={"traversability": 1.0})
        >>> lowest = footprint_layer(grid_map, Footprint.circle(0.3), "traversability", yaws=1)
        >>> np.isfinite(lowest).sum(axis=0)[:, 0]
        array([ 0,  0,  0, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14,
                0,  0,  0])
    """
    values = grid_map.unwrapped(layer)
    is_count = isinstance(yaws, int | np.integer) and yaws >= 1
    check(is_count, "yaws", "a number of directions >= 1", yaws)
    check(statistic in _STATISTICS, "statistic", "'min', 'mean' or 'max'", statistic)
    unknown = np.ascontiguousarray(~np.isfinite(values).T)
    image = np.ascontiguousarray(np.where(unknown, np.float32(0.0), values.T))
    border: dict[str, Any] = {"borderType": cv2.BORDER_CONSTANT, "borderValue": 1.0}
    result = np.empty((*values.shape, yaws), np.float32, order="F")
    for number in range(yaws):
        kernel = kernel_of(footprint, grid_map.resolution, 2.0 * math.pi * number / yaws).T.copy()
        under = _STATISTICS[statistic](image, kernel)
        under[cv2.dilate(unknown.view(np.uint8), kernel, **border) > 0] = np.nan
        result[..., number] = np.roll(under.T, grid_map.start_index, axis=(0, 1))
    return result


def _means(image: NDArray[np.float32], kernel: NDArray[np.uint8]) -> NDArray[np.float32]:
    # cv2.filter2D rounds depending on distant values, so tiles would differ from the whole map.
    padded = np.pad(image.astype(np.float64), [(size // 2, size // 2) for size in kernel.shape])
    edges = np.argwhere(np.diff(kernel, axis=1, prepend=0, append=0))
    begins, lengths = edges[::2], np.diff(edges[:, 1])[::2]
    total, sums = np.zeros(image.shape), padded
    for length in range(1, lengths.max(initial=0) + 1):
        for line, first in begins[lengths == length]:
            total += sums[line:, first:][: image.shape[0], : image.shape[1]]
        sums = sums[:, :-1] + padded[:, length:]
    return (total / np.count_nonzero(kernel)).astype(np.float32)


_STATISTICS: dict[str, Callable[..., Any]] = {"min": cv2.erode, "mean": _means, "max": cv2.dilate}
