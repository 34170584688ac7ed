# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""All cells of a map."""

from typing import TYPE_CHECKING

import numpy as np

from ..arrays._checks import Cells
from ._assembly import empty_cells

if TYPE_CHECKING:
    from ..map._grid_map import GridMap


def map_cells(grid_map: "GridMap") -> Cells:
    """Return the (N, 2) buffer indices of all cells, column after column of the buffer."""
    rows, columns = grid_map.size
    cells = empty_cells(rows * columns)
    block = cells.T.reshape(2, columns, rows)
    block[0] = np.arange(rows)
    block[1] = np.arange(columns)[:, None]
    return cells
