# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Visibility: what a beam passes through is no longer there.

Each beam goes from the sensor to its point through all cells on its way, in order (Amanatides and
Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", 1987). In a cell, the height of a beam is
the largest that it has there. A beam clears a cell that was not confirmed for `scanning_duration`
if it is below `h - 3 sqrt(v)`, unless

- its own point lies in this cell,
- a point of this scan in the cell is higher than the beam, or at most one resolution lower: the
  beam passed beside something that still stands, such as the end of a wall, or
- it grazes the surface: the angle between the beam and the plane through the neighbors is less than
  `cleanup_min_angle`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays._checks import Integers, Mask, Size
from ..loops import loop
from ..map._geometry import GridGeometry
from ._order import Sorted
from ._points import Scan
from ._sensors import Numbers


def entry_heights(scan: Scan, geometry: GridGeometry, chosen: Integers) -> Numbers:
    """Return the heights [m] at which beams entered the cells of their points.

    Args:
        scan: the scan.
        geometry: geometry of the map.
        chosen: (k,) which points; all are on the map.
    """
    rows = geometry.size[0]
    cells = scan.cells[chosen]
    lines = cells % rows, cells // rows
    backward = np.ones(len(chosen))
    points = scan.points[:, chosen]
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis, center in enumerate(geometry.axes_in_map_order()):
            way = points[axis] - scan.sensor[axis]
            border = center[lines[axis]] - np.copysign(0.5 * geometry.resolution, way)
            np.fmin(backward, np.maximum((points[axis] - border) / way, 0.0), out=backward)
    heights: Numbers = points[2] + backward * (scan.sensor[2] - points[2])
    return heights


def cleared_cells(
    scan: Scan,
    points: Sorted,
    heights: Numbers,
    variances: Numbers,
    stale: Mask,
    geometry: GridGeometry,
    max_length: float,
    min_angle: float,
) -> Integers:
    """Return the numbers of the cells that beams prove to be free.

    Args:
        scan: the beams.
        points: the points on the map, sorted by cell.
        heights, variances: (cells,) of the map; a height is NaN where it is unknown.
        stale: (cells,) whether a cell was not confirmed for `scanning_duration`.
        geometry: geometry of the map.
        max_length: length of beams that counts [m].
        min_angle: smallest angle to the surface [rad].
    """
    ceilings = np.where(stale, heights - 3.0 * np.sqrt(variances), -np.inf)
    ceilings[np.isnan(ceilings)] = -np.inf
    ceiling = float(ceilings.max(initial=-np.inf))
    if ceiling == -np.inf:
        return np.zeros(0, np.int64)
    floors = np.full(len(heights), -np.inf)
    floors[points.cells] = points.heights[points.begins] + geometry.resolution
    beams, span = _beams(scan, geometry, max_length, ceiling)
    frame = (
        *((geometry.corner - scan.sensor[:2]) / geometry.resolution).tolist(),
        float(scan.sensor[2]),
        geometry.resolution,
        math.sin(min(min_angle, 0.5 * math.pi)),
    )
    cleared = np.zeros(len(heights), np.uint8)
    run = trace.compiled()
    if run:
        flat = (*map(np.ascontiguousarray, beams), *map(np.ascontiguousarray, span))
        run(*flat, beams.shape[1], frame, geometry.size, heights, ceilings, floors, cleared)
    else:
        _trace_arrays(beams, span, frame, geometry.size, heights, ceilings, floors, cleared)
    return np.flatnonzero(cleared)


def _beams(
    scan: Scan, geometry: GridGeometry, max_length: float, ceiling: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the beams that can clear cells, and the part of each that can.

    Returns:
        beams: (3, k) from the sensor to the point: rows and columns [cells], and height [m].
        span: (2, k) shares of the beam, from 0 at the sensor to 1 at the point: on the map, within
            `max_length` and below `ceiling`.
    """
    beams = scan.points - scan.sensor[:, None]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        length = np.sqrt(beams[0] * beams[0] + beams[1] * beams[1] + beams[2] * beams[2])
        last = np.minimum(max_length / length, 1.0)
        first = np.zeros_like(last)
        beams[:2] /= -geometry.resolution
        start = (geometry.corner - scan.sensor[:2]) / geometry.resolution
        for axis, size in enumerate(geometry.size):
            ends = np.array([[0.0], [size]]) - start[axis]
            ends = ends / beams[axis]
            np.fmax(first, ends.min(axis=0), out=first)
            np.fmin(last, ends.max(axis=0), out=last)
            if not 0.0 <= start[axis] <= size:
                last[beams[axis] == 0.0] = -1.0
        crossing = (ceiling - scan.sensor[2]) / beams[2]
        if scan.sensor[2] >= ceiling:
            first = np.where(beams[2] < 0.0, np.fmax(first, crossing), 2.0)
        else:
            last = np.where(beams[2] > 0.0, np.fmin(last, crossing), last)
    chosen = first < last
    return beams[:, chosen], np.stack((first[chosen], last[chosen]))


def _trace_arrays(
    beams: NDArray[np.float64],
    span: NDArray[np.float64],
    frame: tuple[float, ...],
    size: Size,
    heights: Numbers,
    ceilings: Numbers,
    floors: Numbers,
    cleared: NDArray[np.uint8],
) -> None:
    """Do what `trace` does, with NumPy: one step of all beams at a time."""
    start, (t, last) = np.array(frame[:2])[:, None], span
    with np.errstate(divide="ignore", invalid="ignore"):
        ways, rise = beams[:2], beams[2]
        limits = np.array(size)[:, None] - 1
        lines = np.clip(np.floor(start + t * ways), 0, limits).astype(np.int64)
        forward = ways > 0.0
        steps = np.where(forward, 1, -1)
        delta = np.where(ways == 0.0, np.inf, np.abs(1.0 / ways))
        borders = np.where(ways == 0.0, np.inf, (lines + np.where(forward, 1, 0) - start) / ways)
    while t.size:
        along_rows = borders[0] < borders[1]
        out = np.where(along_rows, borders[0], borders[1])
        goes_on = out < 1.0
        beam = frame[2] + rise * np.where(rise < 0.0, t, np.minimum(out, last))
        cells = lines[0] + size[0] * lines[1]
        passes = np.flatnonzero(goes_on & (beam < ceilings[cells]) & (beam > floors[cells]))
        for i in passes.tolist():
            row, column = lines[:, i].tolist()
            if not grazes(heights, row, column, *size, ways[0, i], ways[1, i], rise[i], *frame[3:]):
                cleared[cells[i]] = 1
        lines[0] += np.where(along_rows, steps[0], 0)
        lines[1] += np.where(along_rows, 0, steps[1])
        goes_on &= (out < last) & (lines >= 0).all(axis=0) & (lines <= limits).all(axis=0)
        borders[0] += np.where(along_rows, delta[0], 0.0)
        borders[1] += np.where(along_rows, 0.0, delta[1])
        t, last, rise, ways = out[goes_on], last[goes_on], rise[goes_on], ways[:, goes_on]
        lines, borders = lines[:, goes_on], borders[:, goes_on]
        steps, delta = steps[:, goes_on], delta[:, goes_on]


def grazes(
    heights: Any,
    row: Any,
    column: Any,
    rows: Any,
    columns: Any,
    along_rows: Any,
    along_columns: Any,
    rise: Any,
    resolution: Any,
    sine: Any,
) -> Any:
    """Return whether a beam is nearly parallel to the plane through the neighbors of a cell."""
    cell = row + rows * column
    here = heights[cell]
    before = heights[cell - 1] if row > 0 else here
    after = heights[cell + 1] if row + 1 < rows else here
    left = heights[cell - rows] if column > 0 else here
    right = heights[cell + rows] if column + 1 < columns else here
    slope_rows, slope_columns = 0.0, 0.0
    # A neighbor without data counts as the cell itself.
    spaces = (row > 0 and before == before) + (row + 1 < rows and after == after)
    if spaces > 0:
        before = before if before == before else here
        after = after if after == after else here
        slope_rows = (after - before) / (spaces * resolution)
    spaces = (column > 0 and left == left) + (column + 1 < columns and right == right)
    if spaces > 0:
        left = left if left == left else here
        right = right if right == right else here
        slope_columns = (right - left) / (spaces * resolution)
    x, y = along_rows * resolution, along_columns * resolution
    across = abs(rise - slope_rows * x - slope_columns * y)
    length = np.sqrt(x * x + y * y + rise * rise)
    normal = np.sqrt(1.0 + slope_rows * slope_rows + slope_columns * slope_columns)
    return across < sine * length * normal


@loop(
    "float64*",
    "float64*",
    "float64*",
    "float64*",
    "float64*",
    "int64",
    ("float64", 5),
    ("int64", 2),
    "float64*",
    "float64*",
    "float64*",
    "uint8*",
)
def trace(  # noqa: C901  a helper would take and return all of its variables
    along_rows: Any,
    along_columns: Any,
    rises: Any,
    firsts: Any,
    lasts: Any,
    count: Any,
    frame: Any,
    size: Any,
    heights: Any,
    ceilings: Any,
    floors: Any,
    cleared: Any,
) -> None:
    """Mark the cells that beams prove to be free.

    Takes the beams and their spans as `_beams` returns them; the place of the sensor in rows and
    columns, its height, the resolution and the sine of the smallest angle; then a height below
    which beams clear a cell, and one above which they do.
    """
    rows, columns = size
    for i in range(count):
        x, y, rise, last = along_rows[i], along_columns[i], rises[i], lasts[i]
        t = firsts[i]
        row = min(max(np.int64(np.floor(frame[0] + t * x)), 0), rows - 1)
        column = min(max(np.int64(np.floor(frame[1] + t * y)), 0), columns - 1)
        next_row, next_column, step_row, step_column = np.inf, np.inf, np.inf, np.inf
        if x != 0.0:
            step_row = abs(1.0 / x)
            next_row = (row + (1 if x > 0.0 else 0) - frame[0]) / x
        if y != 0.0:
            step_column = abs(1.0 / y)
            next_column = (column + (1 if y > 0.0 else 0) - frame[1]) / y
        by_row, by_column = 1 if x > 0.0 else -1, 1 if y > 0.0 else -1
        while True:
            is_row = next_row < next_column
            out = next_row if is_row else next_column
            if not out < 1.0:
                break
            cell = row + rows * column
            beam = frame[2] + rise * (t if rise < 0.0 else min(out, last))
            passes = beam < ceilings[cell] and beam > floors[cell]
            if passes and not grazes(heights, row, column, rows, columns, x, y, rise, *frame[3:]):
                cleared[cell] = 1
                ceilings[cell] = -np.inf
            if not out < last:
                break
            t = out
            if is_row:
                row += by_row
                next_row += step_row
                if row < 0 or row >= rows:
                    break
            else:
                column += by_column
                next_column += step_column
                if column < 0 or column >= columns:
                    break
