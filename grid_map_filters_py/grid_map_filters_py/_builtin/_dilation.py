# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/DilationFilter`"""

from dataclasses import dataclass

from grid_map_core_py._arrays import Layer

from ..parts._layer_filter import FillingDiscFilter, highest_in_disc


@dataclass(frozen=True, kw_only=True)
class Dilation(FillingDiscFilter):
    """Set every finite cell to the largest finite value within `radius` of it."""

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        return highest_in_disc(layer, self.radius, resolution, fill=self.compute_empty_cells)
