# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/NormalColorMapFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.color import color_channels_to_value


@dataclass(frozen=True, kw_only=True)
class NormalColorMap:
    """Colour a map by its normals: red, green, blue are x, y, z taken from [-1, 1] to [0, 1].

    The colours of cells without a normal are NaN.
    """

    input_layers_prefix: str
    output_layer: str

    def __call__(self, grid_map: GridMap) -> GridMap:
        half = np.float32(0.5)
        channels = (grid_map[self.input_layers_prefix + axis] * half + half for axis in "xyz")
        return grid_map.with_layers({self.output_layer: color_channels_to_value(*channels)})
