# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MinInRadiusFilter`"""

from dataclasses import dataclass

from grid_map_core_py._arrays import Layer

from ..parts._layer_filter import DiscFilter, lowest_in_disc


@dataclass(frozen=True, kw_only=True)
class MinInRadius(DiscFilter):
    """Set every finite cell to the smallest finite value within `radius` of it.

    Non-finite cells become NaN.
    """

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        return lowest_in_disc(layer, self.radius, resolution, fill=False)
