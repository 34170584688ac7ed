# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/StepHeightFilter`"""

import math
from dataclasses import dataclass

import numpy as np

from grid_map_core_py._arrays import Layer
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check

from ..parts._disc import Disc, disc_reach
from ..parts._layer_filter import DiscFilter, check_radius, highest_in_disc, lowest_in_disc


@dataclass(frozen=True, kw_only=True)
class StepHeight(DiscFilter):
    """Compute the height of the steps around each cell [m].

    For each finite cell, the filter computes the difference between the highest and the lowest
    finite value in the disc of the given `radius`. This difference is the step height.

    If `second_window_radius` is set, steps of only a few cells count less, because they may be
    noise. The step height is then

        min(1, n / critical_cell_number) * h,

    where h is the largest difference in a second disc around the cell, and n is the number of cells
    in this disc whose difference exceeds `critical_value`. The formula is from M. Wermelinger et
    al., "Navigation planning for legged robots in challenging terrain", IROS 2016.

    Attributes:
        input_layer: heights [m].
        second_window_radius: radius of the second disc [m]; requires `critical_value`.
        critical_value: height difference above which a cell counts as part of a step [m].
        critical_cell_number: number of cells above `critical_value` that make a step count fully.
    """

    second_window_radius: float | None = None
    critical_value: float | None = None
    critical_cell_number: int = 5

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.second_window_radius is None) != (self.critical_value is None):
            raise ConfigError("expected both or none of 'second_window_radius', 'critical_value'")
        check_radius(self.second_window_radius or 0.0, "second_window_radius")
        height = self.critical_value or 0.0
        check(math.isfinite(height) and height >= 0, "critical_value", "a height >= 0 [m]", height)
        number = self.critical_cell_number
        check(number > 0, "critical_cell_number", "a number > 0", number)

    def reach(self, resolution: float) -> float:
        second = self.second_window_radius
        return super().reach(resolution) + (0 if second is None else disc_reach(second, resolution))

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        disc = self.radius, resolution
        with np.errstate(over="ignore"):
            step = highest_in_disc(layer, *disc) - lowest_in_disc(layer, *disc)
        step[~np.isfinite(layer)] = np.nan
        if self.second_window_radius is None:
            return step
        critical = np.where(step > np.float32(self.critical_value or 0.0), step, np.float32(np.nan))
        result = highest_in_disc(step, self.second_window_radius, resolution)
        window = Disc(self.second_window_radius, resolution, layer.shape)
        found, _ = window.padded(critical)
        result *= np.minimum(window.counts(found) / self.critical_cell_number, 1.0)
        return result
