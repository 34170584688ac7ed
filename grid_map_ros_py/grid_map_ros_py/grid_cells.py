# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`nav_msgs/GridCells` and grid maps."""

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import Point
from nav_msgs.msg import GridCells

from grid_map_core_py import GridMap

from .cdr import serialize
from .time import to_header


def to_grid_cells(grid_map: GridMap, layer: str, lower: float, upper: float) -> GridCells:
    """Return the cells whose value is finite and lies between two bounds.

    The message holds one Python object per cell, about a microsecond each: to publish a large map,
    `to_serialized_grid_cells` is faster.

    Args and errors are those of `centres_between`.
    """
    message = _without_cells(grid_map)
    centres = centres_between(grid_map, layer, lower, upper).tolist()
    message.cells = [Point(x=x, y=y, z=z) for x, y, z in centres]
    return message


def to_serialized_grid_cells(grid_map: GridMap, layer: str, lower: float, upper: float) -> bytes:
    """Return what `to_grid_cells` does, in CDR: publishers accept it in place of the message."""
    cells = centres_between(grid_map, layer, lower, upper)
    return serialize(_without_cells(grid_map), {"cells": cells})


def centres_between(
    grid_map: GridMap, layer: str, lower: float, upper: float
) -> npt.NDArray[np.float64]:
    """Return (N, 3) centres x, y [m, map frame], z = 0 of the cells with values between two bounds.

    They come column after column of the map's buffer. Cells without finite value are left out.

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
    return np.pad(centres, ((0, 0), (0, 1)))


def _without_cells(grid_map: GridMap) -> GridCells:
    side = float(np.float32(grid_map.resolution))
    return GridCells(header=to_header(grid_map), cell_width=side, cell_height=side)
