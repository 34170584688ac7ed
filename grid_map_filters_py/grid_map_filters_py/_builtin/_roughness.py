# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/RoughnessFilter`"""

from dataclasses import dataclass

from grid_map_core_py._arrays import Layer

from ..parts._layer_filter import AroundTypicalValue, DiscFilter, Values
from ..parts._normals import SIDE, plane_deviations


@dataclass(frozen=True, kw_only=True)
class Roughness(AroundTypicalValue, DiscFilter):
    """Compute the standard deviation of the points around a cell from their plane [m].

    It is sqrt(sum d^2 / (n - 1)), with the distances d of the n finite points in the disc to the
    plane through their mean. The normal of the plane is that of `NormalVectors` with the same disc.
    This is the roughness filter of traversability_estimation (M. Wermelinger et al.,
    "Navigation planning for legged robots in challenging terrain", IROS 2016). It is NaN where the
    input is not finite, and where the disc has no other finite cell.

    Attributes:
        input_layer: heights [m].
    """

    _side = SIDE

    def _filter_around(self, offset: float, layer: Layer, resolution: float) -> Values:
        return plane_deviations(layer, offset, self.radius, resolution)
