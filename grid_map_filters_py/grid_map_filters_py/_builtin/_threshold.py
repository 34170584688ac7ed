# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/ThresholdFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py.errors import ConfigError

from .._filter import CellFilter
from ..parts._blocks import blockwise


@dataclass(frozen=True, kw_only=True)
class Threshold(CellFilter):
    """Set cells of a layer to a value where a condition layer is below or above a threshold.

    Attributes:
        layer: layer used as both `condition_layer` and `output_layer`.
        condition_layer: layer compared with the threshold; requires `output_layer`.
        output_layer: existing layer in which cells are set; requires `condition_layer`.
        lower_threshold: value below which finite cells are set.
        upper_threshold: value above which finite cells are set. Exactly one of the two thresholds
            is required.
        set_to: new value of the cells; may be `.nan` or `.inf`.
    """

    layer: str | None = None
    condition_layer: str | None = None
    output_layer: str | None = None
    lower_threshold: float | None = None
    upper_threshold: float | None = None
    set_to: float

    def __post_init__(self) -> None:
        if (self.lower_threshold is None) == (self.upper_threshold is None):
            raise ConfigError("expected exactly one of 'lower_threshold' and 'upper_threshold'")
        pair = self.condition_layer, self.output_layer
        if (self.layer is None) == (None in pair) or (self.layer is not None and any(pair)):
            raise ConfigError("expected either 'layer', or 'condition_layer' and 'output_layer'")

    def __call__(self, grid_map: GridMap) -> GridMap:
        condition = grid_map[self.layer or self.condition_layer or ""]
        output_layer = self.layer or self.output_layer or ""
        result = blockwise(self._set, grid_map[output_layer], condition)
        return grid_map.with_layers({output_layer: result})

    def _set(self, layer: Layer, condition: Layer) -> Layer:
        result = layer.copy("F")
        lower, upper = self.lower_threshold, self.upper_threshold
        compare, threshold = (np.greater, upper) if lower is None else (np.less, lower)
        # Without `signature`, the threshold would be rounded to float32.
        passes = compare(condition, np.asarray(threshold), signature="dd->?")
        with np.errstate(over="ignore"):
            result[passes & np.isfinite(condition)] = self.set_to
        return result
