# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/CostFilter`"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py.conversions._costmap import FREE, LETHAL
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check

from .._filter import CellFilter
from ..parts._blocks import blockwise

_GRADED = 252  # number of cost values between free (0) and inscribed (253)


@dataclass(frozen=True, kw_only=True)
class Cost(CellFilter):
    """Convert a layer such as traversability or slope to Nav2 costs.

    The cost of a cell depends on u = (value - free_value) / (lethal_value - free_value):

        0 (free)             if u <= 0,
        1 + floor(252 u)     if 0 < u < 1,
        254 (lethal)         if u >= 1.

    Only `InflationFilter` assigns cost 253. `free_value`, `lethal_value` and `lethal_above` are
    rounded to float32, the precision of the layers.

    Attributes:
        input_layer: layer to convert; cells that are not finite are unknown.
        output_layer: layer for the costs; NaN is unknown.
        free_value: value that gets cost 0, in the unit of `input_layer`.
        lethal_value: value that gets cost 254; may be less than `free_value`.
        unknown: cost of unknown cells: `unknown` means NaN, `lethal` means 254, `free` means 0.
        lethal_layer: second layer that can make cells lethal, such as step height; requires
            `lethal_above`.
        lethal_above: value of `lethal_layer` above which a cell is lethal, even if `input_layer` is
            unknown there. NaN in `lethal_layer` has no effect.
    """

    input_layer: str
    output_layer: str
    free_value: float
    lethal_value: float
    unknown: Literal["unknown", "lethal", "free"] = "unknown"
    lethal_layer: str | None = None
    lethal_above: float | None = None

    def __post_init__(self) -> None:
        for name in ("free_value", "lethal_value", "lethal_above"):
            value, expected = getattr(self, name), "a finite number in the unit of its layer"
            check(value is None or math.isfinite(_rounded(value)), name, expected, value)
        differ = _rounded(self.lethal_value) != _rounded(self.free_value)
        check(differ, "lethal_value", "another number than free_value", self.lethal_value)
        if (self.lethal_layer is None) != (self.lethal_above is None):
            raise ConfigError("expected both or none of 'lethal_layer', 'lethal_above'")

    def __call__(self, grid_map: GridMap) -> GridMap:
        names = [self.input_layer, *([] if self.lethal_layer is None else [self.lethal_layer])]
        costs = blockwise(self._costs, *(grid_map[name] for name in names))
        return grid_map.with_layers({self.output_layer: costs})

    def _costs(self, values: Layer, second: Layer | None = None) -> npt.NDArray[np.float64]:
        free, extent = self.free_value, self.lethal_value - self.free_value
        low, high = ((_rounded(limit) - free) / extent for limit in (free, self.lethal_value))
        share = values.astype(np.float64)
        share -= free
        share /= extent
        costs = np.floor(_GRADED * share)
        costs += 1
        costs[share <= max(low, 0)] = FREE
        costs[share >= min(high, 1)] = LETHAL
        missing = {"unknown": np.nan, "lethal": LETHAL, "free": FREE}[self.unknown]
        costs[~np.isfinite(values)] = missing
        if second is not None and self.lethal_above is not None:
            costs[second > _rounded(self.lethal_above)] = LETHAL
        return costs


def _rounded(value: float) -> float:
    """Round to float32; a value outside the float32 range becomes infinite."""
    with np.errstate(over="ignore"):
        return float(np.float32(value))
