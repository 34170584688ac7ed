# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Roughness`, against loops over cells."""

from functools import partial

import numpy as np
import pytest
from filter_cases import CELLS_OF_PLANES, filtered, points_in_disc, terrain
from hypothesis import given, settings

from grid_map_core_py.testing import grid_maps

roughness = partial(filtered, "gridMapFilters/RoughnessFilter")


@given(grid_maps(allow_moved=False), CELLS_OF_PLANES)
@settings(max_examples=40)
def test_roughness_is_the_deviation_from_the_plane(grid_map, cells):
    radius = cells * grid_map.resolution
    result = roughness(grid_map, radius=radius)
    for index in np.ndindex(grid_map.size):
        points = points_in_disc(grid_map, index, radius)
        if not np.isfinite(grid_map["elevation"][index]) or len(points) < 2:
            assert np.isnan(result[index])
            continue
        values = np.linalg.eigvalsh(np.cov(points.T))
        biased = values * (len(points) - 1) / len(points)
        # The plane of points on a line is horizontal.
        flat = len(points) < 3 or biased[1] <= 1e-8
        expected = points[:, 2].std(ddof=1) if flat else np.sqrt(max(values[0], 0.0))
        spread = np.sqrt(values[2])
        assert result[index] == pytest.approx(expected, rel=1e-4, abs=1e-5 * spread + 1e-7)


def test_slopes_are_smooth_and_noise_is_rough():
    grid_map = terrain((40, 40))
    noise = np.random.default_rng(1).normal(scale=0.02, size=(40, 40))
    plane = 0.5 * grid_map.get_positions()[:, 0].reshape(40, 40, order="F")
    grid_map["elevation"] = 1000 + plane
    assert np.nanmax(roughness(grid_map, radius=0.3)) < 1e-4
    grid_map["elevation"] = plane + noise
    # The distance to an inclined plane is smaller than the difference in height.
    expected = 0.02 * np.cos(np.arctan(0.5))
    assert np.median(roughness(grid_map, radius=0.5)) == pytest.approx(expected, rel=0.05)
