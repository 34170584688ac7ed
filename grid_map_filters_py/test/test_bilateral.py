# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Bilateral`, against a loop over cells."""

from functools import partial

import numpy as np
from filter_cases import assert_cells_are, filtered, ground, points_in_disc
from hypothesis import given, settings, strategies as st

from grid_map_core_py.testing import grid_maps

bilateral = partial(filtered, "gridMapFilters/BilateralFilter")


@given(
    grid_maps(allow_moved=False),
    st.floats(0.3, 2.0),
    st.floats(0.1, 1e3),
    st.sampled_from([None, 1.0, 2.5]),
)
@settings(max_examples=40)
def test_bilateral_weighs_by_distance_and_by_difference(grid_map, sigma, sigma_range, radius):
    sigma *= grid_map.resolution
    radius = None if radius is None else radius * grid_map.resolution
    reach = 3 * sigma if radius is None else radius
    result = bilateral(grid_map, sigma_space=sigma, sigma_range=sigma_range, radius=radius)
    heights = grid_map["elevation"].astype(np.float64)

    def mean(index):
        if not np.isfinite(heights[index]):
            return np.nan
        points = points_in_disc(grid_map, index, reach)
        distances = np.linalg.norm(points[:, :2] - grid_map.get_position(index), axis=1)
        differences = points[:, 2] - heights[index]
        exponents = (distances / sigma) ** 2 + (differences / sigma_range) ** 2
        return np.average(points[:, 2], weights=np.exp(-0.5 * exponents))

    assert_cells_are(result, mean, rtol=1e-4, atol=1e-3)


def test_bilateral_keeps_an_edge_that_a_gaussian_blurs():
    noise = np.random.default_rng(2).normal(scale=0.01, size=(30, 30))
    heights = np.where(np.arange(30)[:, None] < 15, 0.0, 1.0) + noise
    sharp = bilateral(ground(heights), sigma_space=0.2, sigma_range=0.1)
    blurred = filtered("gridMapFilters/GaussianBlurFilter", ground(heights), sigma=0.2)
    assert (sharp[15] - sharp[14]).min() > 0.97
    assert (blurred[15] - blurred[14]).max() < 0.3
    assert sharp[:14].std() < 0.4 * noise.std()
