# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ColorFillFilter`"""

from dataclasses import dataclass, field

import numpy as np

from grid_map_core_py import GridMap, color_vector_to_value

from .._filter import CellFilter
from ..parts._cell_function import Value, cell_function, choose, is_finite
from ..parts._colors import check_color

_NAN = np.float32(np.nan)


@dataclass(frozen=True, kw_only=True)
class ColorFill(CellFilter):
    """Fill a layer with one color.

    Attributes:
        red, green, blue: color component, clamped to [0, 1].
        mask_layer: layer whose finite cells get the color; the other cells become NaN. If the name
            is empty, all cells get the color.
        output_layer: layer for the result.
    """

    red: float
    green: float
    blue: float
    mask_layer: str = ""
    output_layer: str
    _value: np.float32 = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        color = self.red, self.green, self.blue
        check_color("red, green, blue", color)
        value = color_vector_to_value(np.clip(color, 0.0, 1.0).astype(np.float32))
        object.__setattr__(self, "_value", np.float32(value))
        _where_finite.prepare()

    def __call__(self, grid_map: GridMap) -> GridMap:
        if self.mask_layer:
            filled = _where_finite([grid_map[self.mask_layer]], (self._value,))
        else:
            filled = np.full(grid_map.size, self._value, order="F")
        return grid_map.with_layers({self.output_layer: filled})


@cell_function(takes=np.float32, gives=np.float32, numbers=1)
def _where_finite(mask: Value, color: tuple[Value, ...]) -> Value:
    return choose(is_finite(mask), color[0], _NAN)
