# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/NormalColorMapFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap

from .._filter import CellFilter
from ..parts._cell_function import Value, cell_function
from ..parts._colors import or_none, pack

_ONE, _HALF = np.float32(1), np.float32(127.5)


@dataclass(frozen=True, kw_only=True)
class NormalColorMap(CellFilter):
    """Color a map by its normals: x, y, z in [-1, 1] are mapped to red, green, blue in [0, 1].

    Cells without a normal get no color.

    Attributes:
        input_layers_prefix: prefix of the normal layers, which end in `x`, `y` and `z`.
        output_layer: layer for the result.
    """

    input_layers_prefix: str
    output_layer: str

    def __post_init__(self) -> None:
        _color.prepare()

    def __call__(self, grid_map: GridMap) -> GridMap:
        normals = [grid_map[self.input_layers_prefix + axis] for axis in "xyz"]
        return grid_map.with_layers({self.output_layer: _color(normals)})


@cell_function(takes=np.float32, gives=np.uint32)
def _color(x: Value, y: Value, z: Value, _: tuple[Value, ...]) -> Value:
    exists = (x == x) & (y == y) & (z == z)
    return or_none(pack(_channel(x), _channel(y), _channel(z)), exists)


def _channel(normal: Value) -> Value:
    # The result is bitwise equal to 255 * (0.5 * normal + 0.5).
    return (normal + _ONE) * _HALF
