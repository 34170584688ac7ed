# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""All cells of a map."""

import numpy as np

from ..arrays import Cells
from ..grid_map import GridMap


def map_cells(grid_map: GridMap) -> Cells:
    """Return the (N, 2) buffer indices of all cells, column after column of the buffer."""
    rows, columns = grid_map.size
    cells = np.empty((rows * columns, 2), dtype=np.int64)
    cells[:, 0] = np.tile(np.arange(rows), columns)
    cells[:, 1] = np.repeat(np.arange(columns), rows)
    return cells
