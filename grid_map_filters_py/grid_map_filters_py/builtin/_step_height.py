# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/StepHeightFilter`"""

import math
from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Layer
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check

from .._filter import in_map_order
from .._shared.disc_filter import check_radius
from .._shared.morphology import highest_in_disc, lowest_in_disc
from ..parts._disc import Disc, tiles


@dataclass(frozen=True, kw_only=True)
class StepHeight:
    """Compute the height of the steps around each cell [m].

    With one window, it is the difference between the highest and the lowest finite cell of a disc,
    at finite cells. With two windows, as in the step filter of traversability_estimation
    (M. Wermelinger et al., "Navigation planning for legged robots in challenging terrain",
    IROS 2016), it is

        min(1, n / critical_cell_number) * h,

    where h is the largest such difference in the second disc and n the number of cells there in
    which it exceeds `critical_value`: a few cells, which may be noise, make no step.

    Attributes:
        input_layer: heights [m].
        output_layer: layer for the result.
        radius: radius of the disc [m], 0 or more; the rim is inside.
        second_window_radius: radius of the second disc [m]; requires `critical_value`. Every cell
            with a finite difference in this disc gets a value.
        critical_value: height above which a difference counts as a step [m].
        critical_cell_number: number of cells that make a step.
    """

    input_layer: str
    output_layer: str
    radius: float
    second_window_radius: float | None = None
    critical_value: float | None = None
    critical_cell_number: int = 5

    def __post_init__(self) -> None:
        check_radius(self.radius)
        if (self.second_window_radius is None) != (self.critical_value is None):
            raise ConfigError("expected both or none of 'second_window_radius', 'critical_value'")
        check_radius(self.second_window_radius or 0.0, "second_window_radius")
        height = self.critical_value or 0.0
        check(math.isfinite(height) and height >= 0, "critical_value", "a height >= 0 [m]", height)
        number = self.critical_cell_number
        check(number > 0, "critical_cell_number", "a number > 0", number)

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        heights = grid_map[self.input_layer]
        disc = Disc(self.radius, grid_map.resolution, grid_map.size)
        with np.errstate(over="ignore"):
            step = highest_in_disc(heights, disc) - lowest_in_disc(heights, disc)
        step[~np.isfinite(heights)] = np.nan
        if self.second_window_radius is not None:
            step = self._weigh(step, Disc(self.second_window_radius, disc.resolution, disc.size))
        return grid_map.with_layers({self.output_layer: step})

    def _weigh(self, step: Layer, disc: Disc) -> Layer:
        critical = np.where(step > np.float32(self.critical_value or 0.0), step, np.float32(np.nan))
        result = highest_in_disc(step, disc)
        for tile in tiles(disc):
            found, _ = tile.finite(critical, 0.0)
            share = np.minimum(tile.counts(found) / self.critical_cell_number, 1.0)
            result[tile.rows, tile.columns] *= tile.cells(share)
        return result
