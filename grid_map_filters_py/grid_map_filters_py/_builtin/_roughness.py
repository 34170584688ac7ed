# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/RoughnessFilter`"""

from dataclasses import dataclass

from grid_map_core_py._arrays import Layer

from ..parts._layer_filter import AroundTypicalValue, DiscFilter, Values
from ..parts._normals import plane_deviations


@dataclass(frozen=True, kw_only=True)
class Roughness(AroundTypicalValue, DiscFilter):
    """Compute the roughness [m]: the deviation of the points around each cell from a plane.

    The roughness is sqrt(sum(d^2) / (n - 1)), where n is the number of finite points in the disc,
    and d is the distance of a point from the plane. The plane is fitted to these points as in
    `NormalVectors`. traversability_estimation uses the same definition (M. Wermelinger et al.,
    "Navigation planning for legged robots in challenging terrain", IROS 2016). The result is NaN
    where the input is not finite or the disc contains no other finite cell.

    Attributes:
        input_layer: heights [m].
    """

    def _filter_around(self, offset: float, layer: Layer, resolution: float) -> Values:
        return plane_deviations(layer, offset, self.radius, resolution)
