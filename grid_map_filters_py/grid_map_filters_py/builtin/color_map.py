# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ColorMapFilter`"""

import math
from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.config import check

from ..colors import Bits, Floats, check_color, color_cells, pack


@dataclass(frozen=True, kw_only=True)
class ColorMap:
    """Colour a layer by a ramp from one value and its colour to another; beyond both it is flat.

    Cells that are not finite have no colour.

    Attributes:
        min_value, max_value: ends of the ramp. In YAML also `min: {value, color}` and `min/value`.
        min_color, max_color: red, green, blue in [0, 1] at its ends.
    """

    input_layer: str
    output_layer: str
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

    def __call__(self, grid_map: GridMap) -> GridMap:
        lowest, highest = np.float32(self.min_value), np.float32(self.max_value)
        first, last = (255 * np.clip(color, 0, 1) for color in (self.min_color, self.max_color))
        ramps = list(zip((last - first).astype(np.float32), first.astype(np.float32), strict=True))

        def color(values: Floats) -> Bits:
            share = values - lowest
            share /= highest - lowest
            np.clip(share, np.float32(0), np.float32(1), out=share)
            # Between two colours no channel leaves its range.
            channels = ((share * slope + start).astype(np.uint8) for slope, start in ramps)
            return pack(channels, missing=values - values)

        colors = color_cells(color, grid_map[self.input_layer])
        return grid_map.with_layers({self.output_layer: colors})
