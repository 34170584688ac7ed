# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ErosionFilter`"""

from dataclasses import dataclass

from grid_map_core_py._arrays import Layer

from ..parts._layer_filter import FillingDiscFilter, lowest_in_disc


@dataclass(frozen=True, kw_only=True)
class Erosion(FillingDiscFilter):
    """Set every finite cell to the smallest finite value within `radius` of it."""

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        return lowest_in_disc(layer, self.radius, resolution, fill=self.compute_empty_cells)
