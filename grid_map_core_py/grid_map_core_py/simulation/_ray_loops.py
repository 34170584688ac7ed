# SPDX-License-Identifier: BSD-3-Clause
"""Beams that cross the patches of a bilinear surface, compiled and in NumPy with the same bits.

Units along the surface are cells: the height `[i, k]` is at `(i, k)`, and the patch `[i, k]` is
between the heights `[i, k]` and `[i + 1, k + 1]`. A beam has six numbers: where it is at range 0
along rows, columns and z [m], and its change per meter of range. Patches are crossed in order, as
by Amanatides and Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987, but each crossing
is computed from the begin of the beam, so that no rounding adds up.
"""

import math
from typing import Any

import numpy as np

from .._arrays._checks import Positions
from .._arrays._pieces import CHUNK, slices
from .._loops import loop


@loop("float32*", "int64", "int64", "float64*", "float64*", "int64", "float64*")
def one_by_one(
    heights: Any, rows: int, columns: int, rays: Any, span: Any, count: int, ranges: Any
) -> None:
    """Write the range of each beam, NaN if it does not return.

    Takes heights (rows, columns), beams (6, count), and the ranges (2, count) between which each
    may meet the surface.
    """
    for ray in range(count):
        row, column, z = rays[ray], rays[count + ray], rays[2 * count + ray]
        d_row, d_column = rays[3 * count + ray], rays[4 * count + ray]
        d_z = rays[5 * count + ray]
        begin, end = span[ray], span[count + ray]
        i = _patch(row + begin * d_row, rows)
        k = _patch(column + begin * d_column, columns)
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
        # A beam that begins in the ground meets it at once.
        ranges[ray] = found if found > 0.0 else np.nan


def _patch(place: float, count: int) -> int:
    """Return the patch of a place along rows or columns."""
    return min(max(math.floor(place), 0), count - 2)


def _crossing(start: float, step: float, patch: int) -> float:
    """Return the range at which a beam leaves a patch along rows or columns."""
    if step == 0.0:
        return np.inf
    return (patch + (step > 0.0) - start) / step


def _above(
    a: Any, b: Any, c: Any, d: Any, u: Any, v: Any, z: Any, d_row: Any, d_column: Any, d_z: Any
) -> Any:
    """Return f of the height f[0] + f[1] t + f[2] t^2 of a beam above a + b u + c v + d u v."""
    return (
        z - (a + b * u + c * v + d * (u * v)),
        d_z - (b * d_row + c * d_column + d * (u * d_column + v * d_row)),
        -d * (d_row * d_column),
    )


def _root(f0: float, f1: float, f2: float) -> float:
    """Return the first t >= 0 at which f0 + f1 t + f2 t^2 <= 0; NaN if there is none.

    The forms are those without cancellation.
    """
    if f0 <= 0.0:
        return 0.0
    square = f1 * f1 - 4.0 * f2 * f0
    if not square >= 0.0:
        return np.nan
    if f1 < 0.0:
        return 2.0 * f0 / (math.sqrt(square) - f1)
    return (math.sqrt(square) + f1) / (-2.0 * f2) if f2 < 0.0 else np.nan


def in_lockstep(heights: Any, rays: Positions, span: Positions, ranges: Positions) -> None:
    """Do what `one_by_one` does, in NumPy: all beams cross a patch at once.

    Args:
        heights: (rows, columns) float32.
        rays, span: beams (6, N) and ranges (2, N).
        ranges: (N,) where the results go.
    """
    with np.errstate(all="ignore"):
        for part in slices(len(ranges), CHUNK):
            _march(heights, rays[:, part], span[:, part], ranges[part])


def _march(heights: Any, rays: Positions, span: Positions, ranges: Positions) -> None:
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
        met = begin + _roots(*_above(a, b, c, d, u, v, z + begin * rays[5], *rays[3:]))
        meets = met <= leave
        ranges[numbers[meets & (met > 0.0)]] = met[meets & (met > 0.0)]
        along_rows = exits[0] <= exits[1]
        patches[0] += np.where(along_rows, np.copysign(1, steps[0]), 0).astype(np.int64)
        patches[1] += np.where(along_rows, 0, np.copysign(1, steps[1])).astype(np.int64)
        goes_on = ~meets & (leave < end) & ((patches >= 0) & (patches <= last)).all(axis=0)
        begin = np.maximum(begin, leave)
        numbers, begin, end = numbers[goes_on], begin[goes_on], end[goes_on]
        rays, patches = rays[:, goes_on], patches[:, goes_on]


def _roots(f0: Any, f1: Any, f2: Any) -> Any:
    """Return `_root` of arrays."""
    root = np.sqrt(f1 * f1 - 4.0 * f2 * f0)
    rising = np.where(f2 < 0.0, (root + f1) / (-2.0 * f2), np.nan)
    return np.where(f0 <= 0.0, 0.0, np.where(f1 < 0.0, 2.0 * f0 / (root - f1), rising))
