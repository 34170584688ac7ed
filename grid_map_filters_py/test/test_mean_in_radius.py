# SPDX-License-Identifier: BSD-3-Clause
"""The filter `MeanInRadius`, against a loop over discs."""

from functools import partial

import numpy as np
from filter_cases import CELLS, assert_cells_are, filtered, ground, points_in_disc
from hypothesis import given, settings

from grid_map_core_py.testing import grid_maps

mean_in_radius = partial(filtered, "gridMapFilters/MeanInRadiusFilter")


@given(grid_maps(allow_moved=False), CELLS)
@settings(max_examples=60)
def test_mean_equals_a_loop_over_discs(grid_map, cells):
    radius = cells * grid_map.resolution

    def mean(index):
        z = points_in_disc(grid_map, index, radius)[:, 2]
        return z.mean() if z.size else np.nan

    assert_cells_are(mean_in_radius(grid_map, radius=radius), mean, rtol=1e-5, atol=1e-3)


def test_mean_in_radius_keeps_small_differences_on_high_ground():
    heights = np.random.default_rng(1).normal(size=(30, 20)).astype(np.float32) * 0.01
    low = mean_in_radius(ground(heights), radius=0.35)
    high = mean_in_radius(ground(heights + np.float32(2000)), radius=0.35)
    np.testing.assert_allclose(high - 2000, low, atol=3e-4)
