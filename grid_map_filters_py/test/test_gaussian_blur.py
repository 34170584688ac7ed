# SPDX-License-Identifier: BSD-3-Clause
"""The filter `GaussianBlur`, against a loop over cells."""

from functools import partial

import numpy as np
from filter_cases import assert_cells_are, filtered
from hypothesis import given, settings, strategies as st

from grid_map_core_py.testing import grid_maps

blur = partial(filtered, "gridMapFilters/GaussianBlurFilter")


@given(
    grid_maps(allow_moved=False),
    st.floats(0.3, 3.0),
    st.sampled_from([None, 0.0, 1.0, 2.5]),
    st.booleans(),
)
@settings(max_examples=40)
def test_gaussian_blur_is_the_weighted_mean_of_the_finite_cells(
    grid_map, sigma, radius, compute_empty_cells
):
    sigma *= grid_map.resolution
    radius = None if radius is None else radius * grid_map.resolution
    reach = 3 * sigma if radius is None else radius
    params = {"sigma": sigma, "radius": radius, "compute_empty_cells": compute_empty_cells}
    result = blur(grid_map, **params)
    rows, columns = np.indices(grid_map.size) * grid_map.resolution
    heights = grid_map["elevation"].astype(np.float64)
    finite = np.isfinite(heights)

    def mean(index):
        across, along = rows - rows[index], columns - columns[index]
        near = np.maximum(np.abs(across), np.abs(along)) <= reach + 1e-9
        used = near & finite
        if not used.any() or not (compute_empty_cells or finite[index]):
            return np.nan
        weights = np.exp(-(across**2 + along**2) / (2 * sigma**2))
        return np.average(heights[used], weights=weights[used])

    assert_cells_are(result, mean, rtol=1e-5, atol=1e-4)
