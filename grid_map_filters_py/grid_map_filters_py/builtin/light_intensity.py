# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/LightIntensityFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.config import check

from ..colors import Bits, Floats, color_cells, pack, to_bytes


@dataclass(frozen=True, kw_only=True)
class LightIntensity:
    """Shade a map in grey by how straight light falls onto its normals.

    Cells without a normal have no colour.

    Attributes:
        input_layers_prefix: the normals are in the layers prefix + x, y, z.
        light_direction: x, y, z of the direction that the light travels in; of any length but 0.
    """

    input_layers_prefix: str
    output_layer: str
    light_direction: tuple[float, ...]

    def __post_init__(self) -> None:
        direction = self.light_direction
        usable = len(direction) == 3 and 0 < np.linalg.norm(direction) < np.inf
        expected = "three finite numbers, not all 0"
        check(bool(usable), "light_direction", expected, list(direction))

    def __call__(self, grid_map: GridMap) -> GridMap:
        towards = -np.asarray(self.light_direction) / np.linalg.norm(self.light_direction)
        along_x, along_y, along_z = towards.astype(np.float32)

        def shade(x: Floats, y: Floats, z: Floats) -> Bits:
            intensity = x * along_x
            intensity += y * along_y
            intensity += z * along_z
            missing = intensity - intensity
            intensity *= np.float32(255)
            grey = to_bytes(intensity)
            return pack((grey, grey, grey), missing)

        normals = (grid_map[self.input_layers_prefix + axis] for axis in "xyz")
        return grid_map.with_layers({self.output_layer: color_cells(shade, *normals)})
