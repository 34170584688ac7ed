# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ErosionFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap

from ..disc import Disc
from ..filter import check_radius
from ..morphology import lowest_in_disc


@dataclass(frozen=True, kw_only=True)
class Erosion:
    """Give every cell the smallest finite value in the disc of `radius` [m] around it.

    Attributes:
        compute_empty_cells: whether cells that are not finite in the input get a value too.
    """

    input_layer: str
    output_layer: str
    radius: float
    compute_empty_cells: bool = False

    def __post_init__(self) -> None:
        check_radius(self.radius)

    def __call__(self, grid_map: GridMap) -> GridMap:
        layer = grid_map[self.input_layer]
        lowest = lowest_in_disc(layer, Disc(self.radius, grid_map.resolution, grid_map.size))
        if not self.compute_empty_cells:
            lowest[~np.isfinite(layer)] = np.nan
        return grid_map.with_layers({self.output_layer: lowest})
