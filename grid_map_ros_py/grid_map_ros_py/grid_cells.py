# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`nav_msgs/GridCells` and grid maps."""

import numpy as np
from geometry_msgs.msg import Point
from nav_msgs.msg import GridCells

from grid_map_core_py import GridMap

from .time import to_header


def to_grid_cells(grid_map: GridMap, layer: str, lower: float, upper: float) -> GridCells:
    """Return the centres of the cells whose value is finite and lies between two bounds.

    The cells come column after column of the map's buffer, with z = 0. The message holds one Python
    object per cell, about a microsecond each: for large maps send an occupancy grid.

    Args:
        grid_map: the map.
        layer: the layer that is compared.
        lower, upper: bounds, both included and rounded to float32 like the layer; `-inf` and `inf`
            take all finite cells.

    Raises:
        LayerNotFoundError: the map lacks the layer.
    """
    values = grid_map[layer].ravel("F")
    with np.errstate(over="ignore"):
        chosen = (values >= np.float32(lower)) & (values <= np.float32(upper))
    centres = grid_map.get_positions()[chosen & np.isfinite(values)]
    side = float(np.float32(grid_map.resolution))
    return GridCells(
        header=to_header(grid_map),
        cell_width=side,
        cell_height=side,
        cells=[Point(x=x, y=y) for x, y in centres.tolist()],
    )
