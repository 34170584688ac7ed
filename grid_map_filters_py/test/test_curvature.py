# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Curvature`, against a loop over cells."""

from functools import partial

import filter_oracles as oracles
import numpy as np
from filter_cases import filtered, terrain
from hypothesis import given, settings

from grid_map_core_py.testing import grid_maps

curvature = partial(filtered, "gridMapFilters/CurvatureFilter")


@given(grid_maps(allow_moved=False))
@settings(max_examples=60)
def test_curvature_is_minus_the_second_differences(grid_map):
    expected = oracles.curvature(grid_map["elevation"], grid_map.resolution)
    slack = 1e-6 * 1e3 / grid_map.resolution**2
    np.testing.assert_allclose(curvature(grid_map), expected, atol=slack)


def test_a_hilltop_has_positive_curvature_and_a_plane_has_none():
    grid_map = terrain((9, 300))
    x, y = grid_map.axes()
    grid_map["hill"] = -(x[:, None] ** 2) - y[None, :] ** 2
    grid_map["plane"] = 1000 + 0.5 * x[:, None] + 0.25 * y[None, :]
    for name, expected in (("hill", 4.0), ("plane", 0.0)):
        result = curvature(grid_map, input_layer=name)
        np.testing.assert_allclose(result[1:-1, 1:-1], expected, atol=0.1)
