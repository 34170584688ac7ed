# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/RoughnessFilter`"""

from dataclasses import dataclass

from grid_map_core_py import GridMap

from .._filter import in_map_order
from .._shared.disc_filter import DiscFilter
from .._shared.normals import plane_deviations


@dataclass(frozen=True, kw_only=True)
class Roughness(DiscFilter):
    """Compute the standard deviation of the points around a cell from their plane [m].

    It is sqrt(sum d^2 / (n - 1)), with the distances d of the n finite points in the disc to the
    plane through their mean. The normal of the plane is that of `NormalVectors` with the same disc.
    This is the roughness filter of traversability_estimation (M. Wermelinger et al.,
    "Navigation planning for legged robots in challenging terrain", IROS 2016). It is NaN where the
    input is not finite, and where the disc has no other finite cell.

    Attributes:
        input_layer: heights [m].
    """

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        heights = grid_map[self.input_layer]
        deviations = plane_deviations(heights, self.radius, grid_map.resolution)
        return grid_map.with_layers({self.output_layer: deviations})
