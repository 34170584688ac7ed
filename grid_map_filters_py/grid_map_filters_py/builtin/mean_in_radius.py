# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MeanInRadiusFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap

from ..disc import Disc, centred, correlate
from ..filter import check_radius


@dataclass(frozen=True, kw_only=True)
class MeanInRadius:
    """Give every cell the mean of the finite values in the disc of `radius` [m] around it.

    Cells without a finite value in their disc become NaN.
    """

    input_layer: str
    output_layer: str
    radius: float

    def __post_init__(self) -> None:
        check_radius(self.radius)

    def __call__(self, grid_map: GridMap) -> GridMap:
        mask, values, offset = centred(grid_map[self.input_layer])
        kernel = Disc(self.radius, grid_map.resolution, grid_map.size).kernel
        count = correlate(mask.astype(np.float64), kernel)
        with np.errstate(invalid="ignore"):
            mean = correlate(values, kernel) / count + offset
        return grid_map.with_layers({self.output_layer: mean})
