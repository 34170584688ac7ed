# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/LightIntensityFilter`"""

import math
from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check

from .._filter import CellFilter
from ..parts._cell_function import Value, cell_function, is_finite
from ..parts._colors import FULL, or_none, pack


@dataclass(frozen=True, kw_only=True)
class LightIntensity(CellFilter):
    """Shade a map in gray, as if lit from one direction.

    The brightness is the cosine of the angle between the normal and the direction to the light.
    Surfaces that face away from the light are black. Cells without a normal get no color.

    Attributes:
        input_layers_prefix: prefix of the normal layers, which end in `x`, `y` and `z`.
        output_layer: layer for the result.
        light_direction: vector (x, y, z) along which the light travels, of any nonzero length.
    """

    input_layers_prefix: str
    output_layer: str
    light_direction: tuple[float, ...]

    def __post_init__(self) -> None:
        direction = self.light_direction
        usable = len(direction) == 3 and 0 < math.hypot(*direction) < math.inf
        check(usable, "light_direction", "three finite numbers, not all 0", list(direction))
        _shade.prepare()

    def __call__(self, grid_map: GridMap) -> GridMap:
        towards = -np.asarray(self.light_direction) / math.hypot(*self.light_direction)
        normals = [grid_map[self.input_layers_prefix + axis] for axis in "xyz"]
        return grid_map.with_layers({self.output_layer: _shade(normals, towards.tolist())})


@cell_function(takes=np.float32, gives=np.uint32, numbers=3)
def _shade(x: Value, y: Value, z: Value, towards: tuple[Value, ...]) -> Value:
    intensity = x * towards[0] + y * towards[1] + z * towards[2]
    gray = FULL * intensity
    return or_none(pack(gray, gray, gray), is_finite(intensity))
