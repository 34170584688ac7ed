# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ColorFillFilter`"""

from dataclasses import dataclass, field

import numpy as np

from grid_map_core_py import GridMap, color_vector_to_value
from grid_map_core_py.arrays import Layer

from ..colors import check_color


@dataclass(frozen=True, kw_only=True)
class ColorFill:
    """Fill a layer with one colour.

    Attributes:
        red, green, blue: in [0, 1]; values beyond are clamped.
        mask_layer: only cells where this layer is finite get the colour, the others none; empty
            for all cells.
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
        value = color_vector_to_value(np.array(color, dtype=np.float32))
        object.__setattr__(self, "_value", np.float32(value))

    def __call__(self, grid_map: GridMap) -> GridMap:
        if self.mask_layer:
            filled = _where_finite(self._value, grid_map[self.mask_layer])
        else:
            filled = np.empty(grid_map.size, np.float32, order="F")
            filled.T[...] = _row(self._value, grid_map.size[0])
        return grid_map.with_layers({self.output_layer: filled})


def _where_finite(color: np.float32, mask: Layer) -> Layer:
    # A number minus itself is 0 or NaN; as integers, these are less and more than any colour.
    with np.errstate(invalid="ignore"):
        filled = mask - mask
    bits = filled.T.view(np.uint32)
    np.maximum(bits, _row(color, len(mask)).view(np.uint32), out=bits)
    return filled


def _row(color: np.float32, length: int) -> Layer:
    """Return what NumPy takes more quickly than a single number, for every row of a transpose."""
    return np.full(length, color)
