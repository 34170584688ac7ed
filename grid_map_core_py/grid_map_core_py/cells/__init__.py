# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Regions of a map as arrays of buffer indices.

Every function returns (N, 2) integers that index the layers directly, in the order that its page
names: `grid_map["elevation"][tuple(cells.T)]`. Only windows come one by one, or as one array.
"""

from .circle import circle_cells
from .ellipse import ellipse_cells
from .line import line_cells, line_cells_between
from .map import map_cells
from .polygon import polygon_cells
from .sliding_window import sliding_windows, window_array
from .spiral import spiral_cells
from .submap import submap_cells

__all__ = [
    "circle_cells",
    "ellipse_cells",
    "line_cells",
    "line_cells_between",
    "map_cells",
    "polygon_cells",
    "sliding_windows",
    "spiral_cells",
    "submap_cells",
    "window_array",
]
