# SPDX-License-Identifier: BSD-3-Clause
"""Intersections of beams with a height layer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Mask, Positions, as_array, as_number
from .._loops import loop
from ..errors import GeometryError, short
from ..map import GridMap


def cast_rays(
    grid_map: GridMap,
    origins: ArrayLike,
    directions: ArrayLike,
    *,
    layer: str = "elevation",
    max_range: float = np.inf,
) -> Positions:
    """Return the ranges at which beams hit the surface of a layer.

    The surface is the same as for `GridMap.at_position` with `Interpolation.LINEAR`. It is bilinear
    between cell centers, and level from the outermost centers to the border. A step between
    neighboring cells is therefore a slope one cell wide. If one of four neighboring heights is not
    finite, the patch between their cell centers is a hole. The ground below the surface is solid: a
    beam from outside the map or through a hole can hit the ground from the side.

    Args:
        grid_map: the terrain.
        origins: (N, 3) start points of the beams, or (3,) for a common start point [m], map frame.
        directions: (N, 3) directions of any nonzero length, map frame.
        layer: name of the height layer [m].
        max_range: range beyond which beams do not return [m].

    Returns:
        (N,) ranges [m]; NaN for beams that do not return, start on or below the surface, or are not
        finite. With unit directions, beams hit at `origins + ranges[:, None] * directions`.

    Raises:
        GeometryError: an array has the wrong shape, or `max_range` is not a number above 0.
        LayerNotFoundError: the map has no such layer.
    """
    along = as_array(directions, np.float64, "directions")
    if along.ndim != 2 or along.shape[1] != 3:
        raise GeometryError(f"directions: expected the shape (N, 3), got {along.shape}")
    begins = as_array(origins, np.float64, "origins")
    if begins.shape not in ((3,), along.shape):
        expected = f"(3,) or {along.shape}"
        raise GeometryError(f"origins: expected the shape {expected}, got {begins.shape}")
    begins = np.broadcast_to(begins, along.shape)
    limit = as_number(max_range, "max_range")
    if not limit > 0.0:
        raise GeometryError(f"max_range: expected a number above 0, got {short(max_range)}")
    geometry, surface = grid_map.geometry, grid_map.unwrapped(layer)
    known = np.isfinite(surface)
    heights = np.pad(np.where(known, surface, np.nan), 1, mode="edge").astype(np.float32, order="C")
    ranges = np.full(len(along), np.nan)
    with np.errstate(all="ignore"):
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        # Rows and columns refer to the padded heights, which start one cell before the map.
        corner = geometry.corner + 0.5 * geometry.resolution
        rays = np.empty((6, len(along)))
        rays[:2] = ((corner - begins[:, :2]) / geometry.resolution).T
        rays[2] = begins[:, 2]
        rays[3:5] = (along[:, :2] / -geometry.resolution).T
        rays[5] = along[:, 2]
        highest = float(surface[known].max(initial=-np.inf))
        span = _span(rays, geometry.size, highest, limit)
    chosen = np.flatnonzero(span[0] <= span[1])
    if len(chosen):
        rays, span = np.take(rays, chosen, axis=1), np.take(span, chosen, axis=1)
        found = np.empty(len(chosen))
        if run := march.compiled():
            run(heights, *heights.shape, rays, span, len(chosen), found)
        else:
            with np.errstate(all="ignore"):
                _march_arrays(heights, rays, span, found)
        ranges[chosen] = found
    return ranges


def _span(rays: Positions, size: tuple[int, int], highest: float, limit: float) -> Positions:
    """Return the nearest and farthest ranges (2, N) at which each beam can hit the surface.

    The nearest range is NaN or exceeds the farthest range if a beam cannot hit the surface.
    """
    begin, end = np.zeros(rays.shape[1]), np.full(rays.shape[1], limit)
    valid: Mask = np.logical_and.reduce(np.isfinite(rays))
    limits = [(0.5, size[0] + 0.5), (0.5, size[1] + 0.5), (-np.inf, highest)]
    for (low, high), start, step in zip(limits, rays[:3], rays[3:], strict=True):
        first, last = (low - start) / step, (high - start) / step
        still = step == 0.0
        valid &= ~still | ((start >= low) & (start <= high))
        begin = np.fmax(begin, np.where(still, 0.0, np.minimum(first, last)))
        end = np.fmin(end, np.where(still, np.inf, np.maximum(first, last)))
    return np.stack([np.where(valid, begin, np.nan), end])


@loop("float32*", "int64", "int64", "float64*", "float64*", "int64", "float64*")
def march(
    heights: Any, rows: int, columns: int, rays: Any, span: Any, count: int, ranges: Any
) -> None:
    """Write the range of each beam to `ranges`; NaN for beams that do not return.

    Height `[i, k]` is at `(i, k)`, with coordinates in cells. Patch `[i, k]` is between the heights
    `[i, k]` and `[i + 1, k + 1]`. Beams advance from patch to patch (Amanatides and Woo, "A Fast
    Voxel Traversal Algorithm for Ray Tracing", 1987).

    Args:
        heights: (rows, columns) heights [m]; a patch with a NaN is a hole.
        rays: (6, count) row, column and z [m] of each beam at range 0, and their change per meter.
        span: (2, count) range limits [m], as returned by `_span`.
        ranges: (count,) output array of ranges [m].
    """
    for ray in range(count):
        row, column, z = rays[ray], rays[count + ray], rays[2 * count + ray]
        d_row, d_column = rays[3 * count + ray], rays[4 * count + ray]
        d_z = rays[5 * count + ray]
        begin, end = span[ray], span[count + ray]
        i = min(max(math.floor(row + begin * d_row), 0), rows - 2)
        k = min(max(math.floor(column + begin * d_column), 0), columns - 2)
        found = np.nan
        crosses = True
        while crosses:
            leave_row, leave_column = _crossing(row, d_row, i), _crossing(column, d_column, k)
            leave = min(leave_row, leave_column, end)
            first = i * columns + k
            a = np.float64(heights[first])
            b = np.float64(heights[first + columns]) - a
            c = np.float64(heights[first + 1]) - a
            d = np.float64(heights[first + columns + 1]) - a - b - c
            u, v = row + begin * d_row - i, column + begin * d_column - k
            f0, f1, f2 = _above(a, b, c, d, u, v, z + begin * d_z, d_row, d_column, d_z)
            met = begin + _root(f0, f1, f2)
            crosses = not met <= leave and leave < end
            if met <= leave:
                found = met
            if leave_row <= leave_column:
                i += 1 if d_row > 0.0 else -1
            else:
                k += 1 if d_column > 0.0 else -1
            crosses = crosses and i >= 0 and i < rows - 1 and k >= 0 and k < columns - 1
            begin = max(begin, leave)
        # Range 0 means that the beam starts in the ground.
        ranges[ray] = found if found > 0.0 else np.nan


def _crossing(start: float, step: float, patch: int) -> float:
    """Return the range at which a beam leaves the row or column `patch`; inf if it never does."""
    if step == 0.0:
        return np.inf
    return (patch + (step > 0.0) - start) / step


def _above(
    a: Any, b: Any, c: Any, d: Any, u: Any, v: Any, z: Any, d_row: Any, d_column: Any, d_z: Any
) -> Any:
    """Return the height of a beam above a patch as coefficients of 1, t and t^2.

    After t meters, the beam is at (u, v, z) + t (d_row, d_column, d_z). The height of the patch is
    a + b u + c v + d u v.
    """
    return (
        z - (a + b * u + c * v + d * (u * v)),
        d_z - (b * d_row + c * d_column + d * (u * d_column + v * d_row)),
        -d * (d_row * d_column),
    )


def _root(f0: float, f1: float, f2: float) -> float:
    """Return the smallest t >= 0 with f0 + f1 t + f2 t^2 <= 0, or NaN if there is none."""
    if f0 <= 0.0:
        return 0.0
    square = f1 * f1 - 4.0 * f2 * f0
    if not square >= 0.0:
        return np.nan
    if f1 < 0.0:
        return 2.0 * f0 / (math.sqrt(square) - f1)
    return (math.sqrt(square) + f1) / (-2.0 * f2) if f2 < 0.0 else np.nan


def _march_arrays(heights: Any, rays: Positions, span: Positions, ranges: Positions) -> None:
    """NumPy version of `march`: advance all beams one patch at a time."""
    last = np.array(heights.shape)[:, None] - 2
    ranges[...] = np.nan
    numbers = np.arange(len(ranges))
    begin, end = span
    patches = np.clip(np.floor(rays[:2] + begin * rays[3:5]).astype(np.int64), 0, last)
    while len(numbers):
        starts, z, steps = rays[:2], rays[2], rays[3:5]
        exits = np.where(steps == 0.0, np.inf, (patches + (steps > 0.0) - starts) / steps)
        leave = np.minimum(exits.min(axis=0), end)
        i, k = patches
        a = heights[i, k].astype(np.float64)
        b, c = heights[i + 1, k] - a, heights[i, k + 1] - a
        d = heights[i + 1, k + 1] - a - b - c
        u, v = starts + begin * steps - patches
        f0, f1, f2 = _above(a, b, c, d, u, v, z + begin * rays[5], *rays[3:])
        root = np.sqrt(f1 * f1 - 4.0 * f2 * f0)
        rising = np.where(f2 < 0.0, (root + f1) / (-2.0 * f2), np.nan)
        met = np.where(f1 < 0.0, 2.0 * f0 / (root - f1), rising)
        met = begin + np.where(f0 <= 0.0, 0.0, met)
        meets = met <= leave
        ranges[numbers[meets & (met > 0.0)]] = met[meets & (met > 0.0)]
        along_rows = exits[0] <= exits[1]
        patches[0] += np.where(along_rows, np.copysign(1, steps[0]), 0).astype(np.int64)
        patches[1] += np.where(along_rows, 0, np.copysign(1, steps[1])).astype(np.int64)
        goes_on = ~meets & (leave < end) & ((patches >= 0) & (patches <= last)).all(axis=0)
        begin = np.maximum(begin, leave)
        numbers, begin, end = numbers[goes_on], begin[goes_on], end[goes_on]
        rays, patches = rays[:, goes_on], patches[:, goes_on]
