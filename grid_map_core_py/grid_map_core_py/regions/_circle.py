# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Cells of a disc, and chords of discs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays._checks import Cells, as_pair
from ._assembly import cells_of_runs, checked_radius

if TYPE_CHECKING:
    from ..map._grid_map import GridMap


def circle_cells(grid_map: GridMap, center: ArrayLike, radius: float) -> Cells:
    """Return the cells (rows, cols) whose center is in a disc, row after row.

    The disc is closed: a center within 1e-9 m of the rim is inside. Cells beyond the map are left
    out.

    Args:
        center: (2,) center of the disc [m]; it may be outside the map.
        radius: [m], not negative.

    Raises:
        GeometryError: the radius is negative, or a number is not finite.
    """
    limit, center = checked_radius(radius), as_pair(center, "center")
    rows, _ = grid_map.geometry.box(center - limit, center + limit)
    x, y = grid_map.geometry.axes_in_map_order()
    # The run of a row that misses the disc is empty: its half chord is negative.
    half = half_chords(limit, x[rows] - center[0])
    start = (-y).searchsorted(-(center[1] + half), side="left")
    stop = (-y).searchsorted(-(center[1] - half), side="right")
    return cells_of_runs(grid_map, rows.start, start, stop)


def half_chords(radius: float, distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return half the lengths of chords of a disc; negative for lines that miss the disc.

    Args:
        radius: radius of the disc, more than 0. Add `BORDER_TOLERANCE` [m] to include cell centers
            on the rim, as `circle_cells` does.
        distances: (...) from the center of the disc to the chords, in the unit of the radius.
    """
    # Dividing by the radius first keeps the squares from overflowing.
    across = distances / radius
    rest = (1.0 - across) * (1.0 + across)
    halves: NDArray[np.float64] = radius * np.copysign(np.sqrt(np.abs(rest)), rest)
    return halves
