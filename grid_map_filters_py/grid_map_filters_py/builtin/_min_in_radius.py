# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MinInRadiusFilter`"""

from dataclasses import dataclass

from grid_map_core_py import GridMap

from .._filter import in_map_order
from .._shared.disc_filter import DiscFilter
from .._shared.morphology import lowest_in_disc


@dataclass(frozen=True, kw_only=True)
class MinInRadius(DiscFilter):
    """Give every finite cell the smallest finite value in the disc of `radius` [m] around it.

    Cells that are not finite become NaN.
    """

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        lowest = lowest_in_disc(grid_map[self.input_layer], self.disc(grid_map), fill=False)
        return grid_map.with_layers({self.output_layer: lowest})
