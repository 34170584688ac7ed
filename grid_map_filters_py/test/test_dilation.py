# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Dilation`, against a loop over cells."""

from functools import partial

import filter_oracles as oracles
import numpy as np
from filter_cases import CELLS, filtered
from hypothesis import given, settings
from hypothesis import strategies as st

from grid_map_core_py.testing import grid_maps

dilation = partial(filtered, "gridMapFilters/DilationFilter")


@given(grid_maps(allow_moved=False), CELLS, st.booleans())
@settings(max_examples=40)
def test_dilation_is_the_largest_finite_value_in_the_disc(grid_map, cells, compute_empty_cells):
    radius = cells * grid_map.resolution
    result = dilation(grid_map, radius=radius, compute_empty_cells=compute_empty_cells)
    expected = oracles.extreme_in_disc(
        max, grid_map["elevation"], grid_map.resolution, radius, fill=compute_empty_cells
    )
    np.testing.assert_array_equal(result, expected)
