# SPDX-License-Identifier: BSD-3-Clause
"""Compiled loops over points, loaded after a process has handled many points."""

from typing import Any

import numpy as np

from .._loops import Compiled, Loop, loop

_MANY = 1_000_000
"""Number of points that a process handles before it loads the compiled loops; loading is slow."""

_FEW = 64
"""Largest number of points per cell for insertion sort; its time grows with their square."""

_handled = 0


def ready(wanted: Loop, points: int = 0) -> Compiled | None:
    """Count `points`; return the compiled loop, or None without numba or after few points."""
    global _handled
    _handled += points
    return wanted.compiled() if _handled > _MANY else None


@loop("const float32*", "int64", ("float64", 7), ("int64", 2), "int64*", "uint8*")
def find_cells(xyz: Any, count: int, frame: Any, size: Any, cells: Any, counted: Any) -> None:
    """Find the cells of points, rounding as in `GridGeometry.cells_at`.

    Args:
        xyz: (3, n) coordinates of points [m], float32 or float64.
        frame: lower and upper z limit, half the map lengths (x, y), map center (x, y), and the
            negative resolution; all [m].
        cells: (n,) output; the first k entries are the flat cells of the k counted points.
        counted: (n,) output; 1 for points on the map and within the z limits, else 0.
    """
    lowest, highest, half_x, half_y, center_x, center_y, step = frame
    kept = 0
    for i in range(count):
        x, y, z = np.float64(xyz[i]), np.float64(xyz[count + i]), np.float64(xyz[2 * count + i])
        across, along = half_x - (x - center_x), half_y - (y - center_y)
        counts = z >= lowest and z <= highest and z - z == 0.0
        counts = counts and across >= 0.0 and across < 2.0 * half_x
        counts = counts and along >= 0.0 and along < 2.0 * half_y
        counted[i] = counts
        if counts:
            row = int((x - half_x - center_x) / step)
            column = int((y - half_y - center_y) / step)
            row, column = max(min(row, size[0] - 1), 0), max(min(column, size[1] - 1), 0)
            cells[kept] = row + size[0] * column
            kept += 1


@loop("int64*", "const float32*", "int64*", "float32*", "float32*")
def find_medians(cells: Any, values: Any, places: Any, dealt: Any, medians: Any) -> None:
    """Write the median of the values (n,) in each cell to `medians`.

    `dealt` (n,) is a buffer. `places` contains the first index of each cell in `dealt`.
    """
    for i in range(len(values)):
        dealt[places[cells[i]]] = values[i]
        places[cells[i]] += 1
    begin = 0
    for cell in range(len(places)):
        end = places[cell]
        if end - begin > _FEW:
            dealt[begin:end].sort()
        else:
            for i in range(begin + 1, end):
                value, place = dealt[i], i
                while place > begin and dealt[place - 1] > value:
                    dealt[place] = dealt[place - 1]
                    place -= 1
                dealt[place] = value
        if end > begin:
            lower, upper = dealt[(begin + end - 1) // 2], dealt[(begin + end) // 2]
            medians[cell] = 0.5 * (np.float64(lower) + np.float64(upper))
        begin = end
