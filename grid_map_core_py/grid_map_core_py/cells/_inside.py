# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the cell shapes share."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ..arrays import Cells, Mask, Positions
from ..grid_map import GridMap
from ..ring_buffer import wrap


def cells_inside(
    grid_map: GridMap,
    lower: npt.ArrayLike,
    upper: npt.ArrayLike,
    contains: Callable[[Positions, Positions], Mask],
) -> Cells:
    """Return the (N, 2) buffer indices of the cells whose centre a shape contains.

    They come row by row of the map. `contains(x, y)` gets the centres of the cells in a bounding
    box as (rows, 1) and (1, cols) [m] and returns (rows, cols) bool.
    """
    geometry = grid_map.geometry
    rows, columns = geometry.box(lower, upper)
    x, y = geometry.axes()
    found = np.argwhere(contains(x[rows, None], y[None, columns]))
    return wrap(found + (rows.start, columns.start), grid_map.start_index, grid_map.size)
