# SPDX-License-Identifier: BSD-3-Clause
"""The filter `BufferNormalizer`."""

import numpy as np
from filter_cases import run, terrain

from grid_map_core_py.testing import assert_maps_equal
from grid_map_filters_py._builtin import BufferNormalizer


def test_result_begins_at_the_start_index():
    grid_map = terrain((3, 2), elevation=[[0, 1], [2, 3], [4, 5]])
    grid_map.start_index = (2, 1)
    in_a_chain = run("gridMapFilters/BufferNormalizerFilter", grid_map)
    for result in (in_a_chain, BufferNormalizer()(grid_map)):
        assert result.start_index == (0, 0)
        np.testing.assert_array_equal(result["elevation"], [[5, 4], [1, 0], [3, 2]])
        assert_maps_equal(result, grid_map)
    assert grid_map.start_index == (2, 1)
