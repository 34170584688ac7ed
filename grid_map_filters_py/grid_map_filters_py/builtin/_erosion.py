# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ErosionFilter`"""

from dataclasses import dataclass

from grid_map_core_py import GridMap

from .._filter import in_map_order
from .._shared.disc_filter import DiscFilter
from .._shared.morphology import lowest_in_disc


@dataclass(frozen=True, kw_only=True)
class Erosion(DiscFilter):
    """Give every cell the smallest finite value in the disc of `radius` [m] around it.

    Attributes:
        compute_empty_cells: also give values to cells that are not finite in the input; NaN where
            their disc has no finite value.
    """

    compute_empty_cells: bool = False

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        layer, fill = grid_map[self.input_layer], self.compute_empty_cells
        lowest = lowest_in_disc(layer, self.disc(grid_map), fill=fill)
        return grid_map.with_layers({self.output_layer: lowest})
