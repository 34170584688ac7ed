# SPDX-License-Identifier: BSD-3-Clause
"""Loops over points, for numba: a point is read once, and NumPy would pass through it ten times.

Cells (n,) are int64 numbers of cells, values (n,) are float64.
"""

from typing import Any

import numpy as np

from .._loops import Loop, loop

_MANY = 1_000_000
"""Points that a process handles without compiled loops, whose loading takes as long as these."""

_handled = 0

OUTSIDE, DOUBTFUL = -1, -2
"""In place of the cell of a point that does not count, or that is at a border of the map."""


def count(points: int) -> None:
    """Count points that will be handled."""
    global _handled
    _handled += points


def ready(wanted: Loop) -> Any:
    """Return a compiled loop, or None if it is not worth loading or there is none."""
    return wanted.compiled() if _handled > _MANY else None


def _find(
    points: Any, steps: Any, count: int, frame: Any, size: Any, limits: Any, cells: Any, found: Any
) -> None:
    doubtful = 0
    for i in range(count):
        place = i * steps[0]
        x = np.float64(points[place])
        y = np.float64(points[place + steps[1]])
        z = np.float64(points[place + 2 * steps[1]])
        # As in `GridGeometry.cells_at`.
        row = (x - frame[0] - frame[1]) / frame[4]
        column = (y - frame[2] - frame[3]) / frame[4]
        counts = z >= limits[0] and z <= limits[1] and z - z == 0.0
        near = row > -1.0 and row < size[0] + 1 and column > -1.0 and column < size[1] + 1
        inside = row > frame[5] and row < size[0] - frame[5]
        inside = inside and column > frame[5] and column < size[1] - frame[5]
        cell = OUTSIDE
        if counts and inside:
            cell = np.int64(row) + size[0] * np.int64(column)
        elif counts and near:
            cell = DOUBTFUL
            doubtful += 1
        cells[i] = cell
    found[0] = doubtful


def _finders(dtype: str) -> Any:
    arguments = (f"{dtype}*", ("int64", 2), "int64", ("float64", 6), ("int64", 2), ("float64", 2))
    return loop(*arguments, "int64*", "int64*")(_find)


FIND = {np.dtype(dtype): _finders(dtype) for dtype in ("float32", "float64")}
"""Write the cells of points, or `OUTSIDE` or `DOUBTFUL`, and how many are doubtful.

Takes the memory of the points; steps from point to point and from coordinate to coordinate; the
number of points; half the length and center along x and y, minus the resolution and the rounding
of borders [cells]; the size of the map; the limits of z.
"""


@loop("int64*", "int64", "int64*", "int64*")
def keep_found(cells: Any, count: int, places: Any, found: Any) -> None:
    """Move the cells of points that count to the front; write their places and number."""
    kept = 0
    for i in range(count):
        cell = cells[i]
        cells[kept] = cell
        places[kept] = i
        kept += cell >= 0
    found[0] = kept


@loop("int64*", "float64*", "int64", "float32*")
def keep_largest(cells: Any, values: Any, count: int, layer: Any) -> None:
    """Keep the largest value of each cell."""
    for i in range(count):
        value, known = np.float32(values[i]), layer[cells[i]]
        # Replaces NaN, too. Of 0.0 and -0.0 it keeps the later one, as NumPy does.
        layer[cells[i]] = known if known > value else value


@loop("int64*", "float64*", "int64", "float32*")
def keep_smallest(cells: Any, values: Any, count: int, layer: Any) -> None:
    """Keep the smallest value of each cell."""
    for i in range(count):
        value, known = np.float32(values[i]), layer[cells[i]]
        layer[cells[i]] = known if known < value else value


@loop("int64*", "float64*", "int64", "float64*", "int32*")
def add_up(cells: Any, values: Any, count: int, sums: Any, numbers: Any) -> None:
    """Add values and their number to each cell."""
    for i in range(count):
        sums[cells[i]] += values[i]
        numbers[cells[i]] += 1


@loop("int64*", "uint32*", "int64", "uint64*", "int32*")
def make_keys(cells: Any, bits: Any, count: int, keys: Any, numbers: Any) -> None:
    """Write keys for `middles` from the bits of float32, and add their number to each cell."""
    for i in range(count):
        value = bits[i]
        sortable = ~value if value >> np.uint32(31) else value | np.uint32(0x80000000)
        keys[i] = np.uint64(cells[i]) << np.uint64(32) | np.uint64(np.uint32(sortable))
        numbers[cells[i]] += 1


@loop("uint64*", "int64", "int64*", "int64", "int64*", "uint32*", "uint32*", "uint32*")
def middles(
    keys: Any,
    count: int,
    places: Any,
    cells: int,
    ends: Any,
    dealt: Any,
    lower: Any,
    upper: Any,
) -> None:
    """Sort the values of each cell, and write the two in the middle.

    A key holds a cell in its upper half and a value in its lower one. The values are dealt to the
    places of their cells: `places` has the first one by cell, and `ends` the end of each of the
    `cells` that have values.
    """
    for i in range(count):
        cell = np.int64(keys[i] >> np.uint64(32))
        dealt[places[cell]] = np.uint32(keys[i] & np.uint64(0xFFFFFFFF))
        places[cell] += 1
    begin = 0
    for number in range(cells):
        end = ends[number]
        for i in range(begin + 1, end):
            value = dealt[i]
            place = i
            while place > begin and dealt[place - 1] > value:
                dealt[place] = dealt[place - 1]
                place -= 1
            dealt[place] = value
        lower[number] = dealt[(begin + end - 1) // 2]
        upper[number] = dealt[(begin + end) // 2]
        begin = end


LOOPS = (*FIND.values(), keep_found, keep_largest, keep_smallest, add_up, make_keys, middles)


def prepare() -> None:
    """Load all loops now, for a process that will handle many points."""
    count(_MANY + 1)
    for made in LOOPS:
        ready(made)
