# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The filter `MinInRadius`, against a loop over cells."""

from functools import partial

import filter_oracles as oracles
import numpy as np
from filter_cases import CELLS, filtered
from hypothesis import given, settings

from grid_map_core_py.testing import grid_maps

min_in_radius = partial(filtered, "gridMapFilters/MinInRadiusFilter")


@given(grid_maps(allow_moved=False), CELLS)
@settings(max_examples=40)
def test_minimum_equals_a_loop_over_discs(grid_map, cells):
    radius = cells * grid_map.resolution
    expected = oracles.min_in_radius(grid_map["elevation"], grid_map.resolution, radius)
    np.testing.assert_array_equal(min_in_radius(grid_map, radius=radius), expected)
