# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/TraversabilityFilter`"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py.plugins import check

from .._filter import CellFilter, warn
from ..parts._blocks import blockwise

_RIGHT_ANGLE = 0.5 * math.pi


@dataclass(frozen=True, kw_only=True)
class Traversability(CellFilter):
    """Compute the traversability of cells, from 0 (impassable) to 1 (free).

    Each input layer contributes the term 1 - value / critical value, clamped to [0, 1]. The result
    is the weighted mean of the terms (M. Wermelinger et al., "Navigation planning for legged robots
    in challenging terrain", IROS 2016). It is NaN where an input layer is not finite.

    Attributes:
        input_layers: layers such as slope, step height and roughness, in which 0 is best.
        output_layer: layer for the result.
        critical_values: value of each layer at which its term becomes 0; slopes are in radians.
        weights: weight of each layer; equal by default. Only the ratios matter.
    """

    input_layers: tuple[str, ...]
    output_layer: str
    critical_values: tuple[float, ...]
    weights: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        count = len(self.input_layers)
        check(count > 0, "input_layers", "at least one layer", self.input_layers)
        for name, numbers in (
            ("critical_values", self.critical_values),
            ("weights", self._weights),
        ):
            check(len(numbers) == count, name, f"{count} numbers, one per layer", numbers)
            valid = all(math.isfinite(number) and number >= 0 for number in numbers)
            check(valid, name, "numbers >= 0", numbers)
        check(all(self.critical_values), "critical_values", "numbers > 0", self.critical_values)
        check(any(self._weights), "weights", "a number > 0", self.weights)

    def __call__(self, grid_map: GridMap) -> GridMap:
        layers = [grid_map[name] for name in self.input_layers]
        for name, critical in zip(self.input_layers, self.critical_values, strict=True):
            values = grid_map[name].ravel("K")
            # `fmax` ignores NaN.
            if "slope" in name and critical > _RIGHT_ANGLE >= np.fmax.reduce(values) > 0:
                expected = f"at most {_RIGHT_ANGLE:.4g} [rad] for {name}, got {critical:g}"
                degrees = f"{critical:g} degrees are {math.radians(critical):.4g} rad"
                warn(f"critical_values: expected {expected}. {degrees}")
        return grid_map.with_layers({self.output_layer: blockwise(self._mean, *layers)})

    def _mean(self, *layers: Layer) -> npt.NDArray[np.float64]:
        total = np.zeros(layers[0].shape)
        for layer, critical, weight in zip(
            layers, self.critical_values, self._weights, strict=True
        ):
            with np.errstate(over="ignore"):
                score = np.clip(1.0 - layer.astype(np.float64) / critical, 0.0, 1.0)
            score[~np.isfinite(layer)] = np.nan
            total += weight / sum(self._weights) * score
        return np.minimum(total, 1.0)

    @property
    def _weights(self) -> tuple[float, ...]:
        return (1.0,) * len(self.input_layers) if self.weights is None else self.weights
