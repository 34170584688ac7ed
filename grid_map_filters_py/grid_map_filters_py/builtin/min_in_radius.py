# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MinInRadiusFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap

from ..disc import Disc
from ..filter import check_radius
from ..morphology import lowest_in_disc


@dataclass(frozen=True, kw_only=True)
class MinInRadius:
    """Give every finite cell the smallest finite value in the disc of `radius` [m] around it.

    The other cells become NaN.
    """

    input_layer: str
    output_layer: str
    radius: float

    def __post_init__(self) -> None:
        check_radius(self.radius)

    def __call__(self, grid_map: GridMap) -> GridMap:
        layer = grid_map[self.input_layer]
        lowest = lowest_in_disc(layer, Disc(self.radius, grid_map.resolution, grid_map.size))
        lowest[~np.isfinite(layer)] = np.nan
        return grid_map.with_layers({self.output_layer: lowest})
