# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ColorMapFilter`"""

import math
from dataclasses import dataclass

import numpy as np

from grid_map_core_py._arrays import Layer
from grid_map_core_py.plugins import check

from .._filter import CellFilter
from ..parts._cell_function import Value, cell_function, clamp, is_finite
from ..parts._colors import check_color, or_none, pack
from ..parts._layer_filter import LayerFilter

_FIRST, _LAST = np.float32(0), np.float32(1)


@dataclass(frozen=True, kw_only=True)
class ColorMap(CellFilter, LayerFilter):
    """Color a layer with a linear color ramp between two values.

    Values outside the ramp get the color of the nearer end. Non-finite cells become NaN (no color).

    Attributes:
        input_layer: layer with the values.
        min_value: value that gets `min_color`. YAML files may also use `min/value`, or a mapping
            `min` with the keys `value` and `color`.
        max_value: value that gets `max_color`; must exceed `min_value`.
        min_color: red, green and blue at `min_value`, clamped to [0, 1].
        max_color: red, green and blue at `max_value`, clamped to [0, 1].
    """

    min_value: float
    max_value: float
    min_color: tuple[float, ...]
    max_color: tuple[float, ...]

    def __post_init__(self) -> None:
        check_color("min/color", self.min_color)
        check_color("max/color", self.max_color)
        check(math.isfinite(self.min_value), "min/value", "a finite number", self.min_value)
        ascends = math.isfinite(self.max_value) and self.max_value > self.min_value
        expected = f"a finite number above min/value, {self.min_value}"
        check(ascends, "max/value", expected, self.max_value)
        longest = float(np.finfo(np.float32).max)
        in_range = max(abs(self.min_value), self.max_value - self.min_value) <= longest
        check(in_range, "max/value", f"a ramp of at most {longest:g}", self.max_value)
        _color.prepare()

    def _filter(self, layer: Layer, _resolution: float) -> Layer:
        first, last = (255 * np.clip(color, 0, 1) for color in (self.min_color, self.max_color))
        width = np.float32(self.max_value) - np.float32(self.min_value)
        ramp = (self.min_value, width, *(last - first), *first)
        return _color([layer], ramp)


@cell_function(takes=np.float32, gives=np.uint32, numbers=8)
def _color(value: Value, ramp: tuple[Value, ...]) -> Value:
    share = clamp((value - ramp[0]) / ramp[1], _FIRST, _LAST)
    red = share * ramp[2] + ramp[5]
    green = share * ramp[3] + ramp[6]
    blue = share * ramp[4] + ramp[7]
    return or_none(pack(red, green, blue), is_finite(value))
