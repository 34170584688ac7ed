# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Regions of a map as arrays of buffer indices.

Every function returns (N, 2) integers that index the layers directly, in the order that its page
names: `grid_map["elevation"][tuple(cells.T)]`.
"""

from .circle import circle_cells
from .map import map_cells
from .submap import submap_cells

__all__ = ["circle_cells", "map_cells", "submap_cells"]
