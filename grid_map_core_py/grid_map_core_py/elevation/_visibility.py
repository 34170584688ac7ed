# SPDX-License-Identifier: BSD-3-Clause
"""Visibility cleanup: clears the cells that beams have passed through.

Each beam is traced from the sensor to its point, cell by cell (Amanatides and Woo, "A Fast Voxel
Traversal Algorithm for Ray Tracing", 1987). The height of a beam in a cell is the largest height of
the beam within the cell. The foot of a cell with height h and variance v is the height
`h - max(3 sqrt(v), RELIEF * resolution)`.

A beam below the foot of a cell clears the cell if the cell was not confirmed for
`scanning_duration`. There are four exceptions:

- The point of the beam is in the cell.
- This scan has a point in the cell or its 8 neighbors that is higher than the beam, or at most one
  resolution lower. The beam then passed next to an obstacle, such as a wall that covers part of the
  cell.
- A cell at most two cells away still contains an obstacle, such as a wall. Beams along a wall pass
  between the points of the wall. A cell contains an obstacle if all conditions hold:
  - No beam crossed the cell below its foot.
  - The foot is higher than the beam, or at most one resolution lower.
  - The foot is more than one resolution above the lowest height in the 3 x 3 cells around the cell
    to be cleared.
- The beam grazes the surface: the angle between the beam and the plane through the neighbors is
  less than `cleanup_min_angle`.

Before a beam is traced, its end is raised by three standard deviations of its point. A beam that
enters the ground clears no cells behind that place. A beam enters the ground in a cell if it leaves
the cell below the feet of all cells in the 3 x 3 neighborhood that this scan confirmed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .._arrays._checks import Integers, Size
from .._loops import loop
from ..map._geometry import GridGeometry
from ._clusters import RELIEF, Sorted
from ._parameters import Numbers, Parameters
from ._points import Scan
from ._state import State, highest_around


def entry_heights(scan: Scan, geometry: GridGeometry, order: Integers, chosen: Integers) -> Numbers:
    """Return the heights (k,) [m] at which beams entered the cells of their points.

    `chosen` (k,) contains indices into `order`, the scan indices of the points on the map.
    """
    chosen = order[chosen]
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
    return np.asarray(points[2] + backward * (scan.sensor[2] - points[2]))


def cleared_cells(
    scan: Scan,
    points: Sorted,
    state: State,
    confirmed: Integers,
    geometry: GridGeometry,
    given: Parameters,
) -> Integers:
    """Return the indices of the cells that beams show to be free."""
    heights, size, resolution = state.heights, geometry.size, geometry.resolution
    candidates = np.flatnonzero(state.is_stale(given) & ~np.isnan(heights))
    if not len(candidates):
        return candidates
    feet = heights - np.maximum(3.0 * np.sqrt(state.variances), RELIEF * resolution)
    lowest = feet[candidates]
    ceilings, places = np.full(len(heights), -np.inf), np.empty(len(heights), np.int64)
    ceilings[candidates], places[candidates] = lowest, np.arange(len(candidates))
    floors = np.full(len(heights), -np.inf)
    floors[points.cells] = points.heights[points.begins] + resolution
    floors = highest_around(floors, size)[candidates].astype(np.float64)
    # For each cell, the lowest foot among the confirmed cells around it.
    guards = np.full(len(heights), np.nan)
    guards[confirmed] = -feet[confirmed]
    guards = -highest_around(guards, size).astype(np.float64)
    guards[guards == np.inf] = -np.inf
    frame = (
        *((geometry.corner - scan.sensor[:2]) / resolution).tolist(),
        float(scan.sensor[2]),
        resolution,
        math.sin(min(given.cleanup_min_angle, 0.5 * math.pi)),
        given.max_ray_length,
    )
    proofs, crossed = np.full(len(candidates), np.inf), np.zeros(len(candidates), np.uint8)
    normals = _normals(heights, candidates, size, resolution).T.ravel()
    surface = ceilings, places, floors, normals, guards, proofs, crossed
    ways = scan.points - scan.sensor[:, None]
    ways[2] += 3.0 * np.sqrt(scan.variances + scan.variances_by_pose(*scan.points[:2]))
    if (run := trace.compiled()) and (prepare := cover.compiled()):
        table = np.full(SECTORS * RINGS, -np.inf)
        prepare(candidates, lowest, len(candidates), frame, size, table)
        run((*ways,), ways.shape[1], frame, size, table, surface)
    else:
        _trace_arrays(ways, frame, size, surface)
    proven = np.flatnonzero(proofs < np.inf)
    found, beams = candidates[proven], proofs[proven]
    # Do not clear cells next to an obstacle that no beam crossed, as they may be part of it.
    feet[candidates[crossed.view(np.bool_)]] = np.nan
    ground = -highest_around(-heights, size)[found]
    beside = highest_around(feet, size, 2)[found]
    stands = beside > np.maximum(beams, ground + 2.0 * resolution) - resolution
    return np.asarray(found[~stands])


def _trace_arrays(ways: Any, frame: tuple[float, ...], size: Size, surface: Any) -> None:
    """NumPy version of `trace`, vectorized over beams."""
    ceilings, places, floors, normals, guards, proofs, crossed = surface
    start, limits = np.array(frame[:2])[:, None], np.array(size)[:, None]
    with np.errstate(all="ignore"):
        length = np.sqrt(ways[0] * ways[0] + ways[1] * ways[1] + ways[2] * ways[2])
        ways, rise = ways[:2] / -frame[3], ways[2]
        # Beam parameters at the map borders, from 0 at the sensor to 1 at the point.
        ends = np.stack([-start / ways, (limits - start) / ways])
        still = ways == 0.0
        off = (still & ((start < 0.0) | (start > limits))).any(axis=0) | still.all(axis=0)
        ends = np.where(still, np.array([-np.inf, np.inf])[:, None, None], ends)
        t = np.maximum(ends.min(axis=0).max(axis=0), 0.0)
        # Rounding must not move the end beyond the border.
        last = np.minimum(ends.max(axis=0).min(axis=0) * (1.0 - 1e-9), 1.0)
        last = np.minimum(last, frame[5] / length)
        on_map = ~off & (t < last)
        t, last, rise, ways = t[on_map], last[on_map], rise[on_map], ways[:, on_map]
        lines = np.clip(np.floor(start + t * ways), 0, limits - 1).astype(np.int64)
        forward = ways > 0.0
        steps = np.where(forward, 1, -1) * np.array([[1], [size[0]]])
        delta = np.abs(1.0 / ways)
        borders = np.where(ways == 0.0, np.inf, (lines + forward - start) / ways)
    cells = lines[0] + size[0] * lines[1]
    while t.size:
        by_row = borders[0] < borders[1]
        out = np.where(by_row, borders[0], borders[1])
        beam = frame[2] + rise * np.where(rise < 0.0, t, np.minimum(out, last))
        passes = np.flatnonzero((out < 1.0) & (beam < ceilings[cells]))
        place = places[cells[passes]]
        x, y = ways[:, passes]
        crossed[place] = 1
        proves = faces(normals, 3 * place, x, y, rise[passes], frame[3], frame[4])
        proves &= beam[passes] > floors[place]
        np.minimum.at(proofs, place[proves], beam[passes[proves]])
        goes_on = frame[2] + rise * np.minimum(out, last) >= guards[cells]
        cells += np.where(by_row, steps[0], steps[1])
        borders[0] += np.where(by_row, delta[0], 0.0)
        borders[1] += np.where(by_row, 0.0, delta[1])
        left = goes_on & (out < last) & (cells >= 0) & (cells < len(ceilings))
        t, last, rise, ways = out[left], last[left], rise[left], ways[:, left]
        cells, borders, steps, delta = cells[left], borders[:, left], steps[:, left], delta[:, left]


def _normals(heights: Numbers, cells: Integers, size: Size, resolution: float) -> Numbers:
    """Return the upward unit normals (3, k) of the surface in `cells`, as rows, columns and z."""
    here, normals = heights[cells], np.ones((3, len(cells)))
    lines = cells % size[0], cells // size[0]
    for axis, (line, step) in enumerate(zip(lines, (1, size[0]), strict=True)):
        rise, spaces = np.zeros(len(cells)), np.zeros(len(cells))
        for sign, is_there in ((-1, line > 0), (1, line + 1 < size[axis])):
            neighbor = heights[np.where(is_there, cells + sign * step, cells)]
            is_there &= ~np.isnan(neighbor)
            rise += np.where(is_there, sign * (neighbor - here), 0.0)
            spaces += is_there
        normals[axis] = -rise / (np.maximum(spaces, 1.0) * resolution)
    normals /= np.sqrt(normals[0] * normals[0] + normals[1] * normals[1] + 1.0)
    return normals


def faces(normals: Any, place: Any, x: Any, y: Any, rise: Any, resolution: Any, sine: Any) -> Any:
    """Return whether a beam meets a surface at an angle whose sine is at least `sine`."""
    x, y = x * resolution, y * resolution
    across = x * normals[place] + y * normals[place + 1] + rise * normals[place + 2]
    return abs(across) >= sine * np.sqrt(x * x + y * y + rise * rise)


MARGIN = 1e-9
"""Height [m] by which `last_ring` lowers beams, so that rounding errors never skip a ring."""

SECTORS, RINGS = 512, 32
"""Size of the polar grid around the sensor; `last_ring` uses this grid to find where beams end."""


def direction(x: Any, y: Any) -> Any:
    """Convert a nonzero vector to a number in [0, `SECTORS`] that increases with its angle."""
    part = y / (abs(x) + abs(y))
    turn = 2.0 - part if x < 0.0 else (part if y >= 0.0 else 4.0 + part)
    return turn * (SECTORS / 4)


def ring_width(frame: Any, size: Any) -> Any:
    """Return the width [cells] of rings that together cover all cells a beam can clear."""
    x = max(abs(frame[0]), abs(size[0] - frame[0]))
    y = max(abs(frame[1]), abs(size[1] - frame[1]))
    return min(np.sqrt(x * x + y * y), frame[5] / frame[3]) * 1.001 / RINGS + 0.1


@loop("int64*", "float64*", "int64", ("float64", 6), ("int64", 2), "float64*")
def cover(cells: Any, lowest: Any, count: Any, frame: Any, size: Any, table: Any) -> None:
    """Set each bin of the polar grid `table` to the maximum of `lowest` over its cells."""
    width = ring_width(frame, size)
    for i in range(count):
        x = cells[i] % size[0] + 0.5 - frame[0]
        y = cells[i] // size[0] + 0.5 - frame[1]
        distance = np.sqrt(x * x + y * y)
        first, span = 0, SECTORS
        if distance > 1.0:
            middle, low, high = direction(x, y), 0.0, 0.0
            for corner in range(4):
                away = direction(x - 0.5 + corner % 2, y - 0.5 + corner // 2) - middle
                away -= SECTORS * np.floor(away / SECTORS + 0.5)
                low, high = min(low, away), max(high, away)
            first = math.floor(middle + low - 1e-6)
            span = math.floor(middle + high + 1e-6) - first + 1
        near = math.floor(max(distance - 0.7072, 0.0) / width)
        far = math.floor(min((distance + 0.7072) / width, RINGS - 1))
        for k in range(first, first + span):
            for ring in range(near, far + 1):
                place = k % SECTORS * RINGS + ring
                table[place] = max(table[place], lowest[i])


def within(start: Any, way: Any, size: Any, first: Any, last: Any) -> Any:
    """Clip the beam parameter range (0: sensor, 1: point) to the map, along one axis."""
    if way == 0.0:
        return first, (last if 0.0 <= start <= size else -1.0)
    one, other = -start / way, (size - start) / way
    # Rounding must not move the end beyond the border.
    return max(first, min(one, other)), min(last, max(one, other) * (1.0 - 1e-9))


def last_ring(frame: Any, table: Any, width: Any, x: Any, y: Any, rise: Any, last: Any) -> Any:
    """Return the beam parameter (0: sensor, 1: point) beyond which a beam clears no cells."""
    distance = np.sqrt(x * x + y * y)
    sector = math.floor(min(direction(x, y), SECTORS - 1)) * RINGS
    ring = math.floor(min(last * distance / width, RINGS - 1))
    step = width / distance
    per_ring = rise * step
    # A descending beam is lowest at the far end of a ring.
    height = frame[2] + (per_ring if rise < 0.0 else 0.0) - MARGIN
    while ring >= 0 and height + per_ring * ring >= table[sector + ring]:
        ring -= 1
    return min(last, (ring + 1) * step)


@loop(
    ("float64*", 3),
    "int64",
    ("float64", 6),
    ("int64", 2),
    "float64*",
    ("float64*", "int64*", "float64*", "float64*", "float64*", "float64*", "uint8*"),
)
def trace(ways: Any, count: Any, frame: Any, size: Any, table: Any, surface: Any) -> None:
    """Find the cells that beams show to be free.

    Args:
        ways: x, y and z of the vectors from the sensor to the points of the beams [m].
        frame: row, column and height of the sensor, the resolution, the sine of
            `cleanup_min_angle`, and `max_ray_length`.
        table: result of `cover`.
        surface: the following seven arrays. Candidates are the cells that may be cleared.
            ceilings: for each cell, the height below which a beam can clear the cell.
            places: index of each cell among the candidates.
            floors: for each candidate, the height above which a beam can clear the candidate.
            normals: surface normals of the candidates, three numbers each.
            guards: for each cell, the height below which a beam ends in the cell.
            proofs: output, the height of the lowest beam that shows each candidate to be free.
            crossed: output, 1 for candidates that a beam crossed below their foot.
    """
    rows, columns = size
    width = ring_width(frame, size)
    for i in range(count):
        x, y, rise = ways[0][i], ways[1][i], ways[2][i]
        length = np.sqrt(x * x + y * y + rise * rise)
        x, y = -x / frame[3], -y / frame[3]
        t, last = within(frame[0], x, rows, 0.0, min(frame[5] / length, 1.0))
        t, last = within(frame[1], y, columns, t, last)
        # A vertical beam stays in the cell of its point, so it clears no cell.
        if t < last and x * x + y * y > 0.0:
            last = last_ring(frame, table, width, x, y, rise, last)
            follow((x, y, rise), (t, last), frame, size, surface)


def follow(way: Any, span: Any, frame: Any, size: Any, surface: Any) -> None:
    """Trace one beam within the range `span` of its parameter; see `trace`."""
    ceilings, places, floors, normals, guards, proofs, crossed = surface
    x, y, rise = way
    t, last = span
    rows, columns = size
    row, next_row, step_row = first_line(frame[0], x, t, rows)
    column, next_column, step_column = first_line(frame[1], y, t, columns)
    by_row, by_column = 1 if x > 0.0 else -1, rows if y > 0.0 else -rows
    cell = row + rows * column
    while t < last and cell >= 0 and cell < rows * columns:
        is_row = next_row < next_column
        out = next_row if is_row else next_column
        if not out < 1.0:
            break
        beam = frame[2] + rise * (t if rise < 0.0 else min(out, last))
        if beam < ceilings[cell]:
            place = places[cell]
            crossed[place] = 1
            passes = beam > floors[place]
            if passes and faces(normals, 3 * place, x, y, rise, frame[3], frame[4]):
                # For this cell, only lower beams matter from now on.
                proofs[place] = ceilings[cell] = beam
        if frame[2] + rise * min(out, last) < guards[cell]:
            break
        t = out
        # There is no branch here, because the processor could not predict it.
        cell += by_row if is_row else by_column
        next_row += step_row if is_row else 0.0
        next_column += 0.0 if is_row else step_column


def first_line(start: Any, way: Any, t: Any, size: Any) -> Any:
    """Return a beam's first row or column, the beam parameter at its end, and the step per line."""
    row = min(max(np.int64(np.floor(start + t * way)), 0), size - 1)
    if way == 0.0:
        return row, np.inf, np.inf
    return row, (row + (1 if way > 0.0 else 0) - start) / way, abs(1.0 / way)
