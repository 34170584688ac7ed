# SPDX-License-Identifier: BSD-3-Clause
"""The filter `MedianFill`, against a loop over cells."""

import filter_oracles as oracles
import numpy as np
from filter_cases import TO_OUT, run, terrain
from hypothesis import given, settings, strategies as st

from grid_map_core_py.testing import grid_maps

PARAMS = {**TO_OUT, "fill_hole_radius": 0.2, "fill_mask_layer": "mask"}


def fill(grid_map, **params):
    return run("gridMapFilters/MedianFillFilter", grid_map, **PARAMS | params)


@given(grid_maps(allow_moved=False), st.integers(0, 5), st.booleans())
@settings(max_examples=40)
def test_holes_of_the_closed_mask_are_filled(grid_map, iterations, existing):
    layer, resolution = grid_map["elevation"], grid_map.resolution
    result = fill(
        grid_map,
        fill_hole_radius=2.5 * resolution,
        num_erode_dilation_iterations=iterations,
        filter_existing_values=existing,
        existing_value_radius=resolution,
        debug=True,
        debug_infill_mask_layer="opened",
    )
    opened, mask = oracles.fill_mask(layer, iterations)
    expected = oracles.median_fill(layer, mask, 2, 1 if existing else None)
    np.testing.assert_array_equal(result["out"], expected)
    np.testing.assert_array_equal(result["opened"], opened)
    np.testing.assert_array_equal(result["mask"], mask)
    assert result.basic_layers == ()


def test_existing_mask_is_used():
    heights = np.array([[np.nan, 1, 2], [np.nan, 3, 4], [5, 6, np.nan]])
    grid_map = terrain((3, 3), elevation=heights, mask=[[0.5, 1, 1], [0, 0, 0], [1, 1, np.nan]])
    result = fill(grid_map, debug=True, debug_infill_mask_layer="opened")
    assert result.layers == ("elevation", "mask", "out")
    np.testing.assert_array_equal(result["mask"], grid_map["mask"])
    np.testing.assert_array_equal(result["out"], [[4, 1, 2], [np.nan, 3, 4], [5, 6, 4]])


def test_huge_number_of_iterations_closes_everything():
    grid_map = terrain((20, 20), elevation=np.nan)
    grid_map["elevation"][3:6, 3:6] = 1.0
    result = fill(grid_map, num_erode_dilation_iterations=2**31, fill_hole_radius=1e9)
    np.testing.assert_array_equal(result["mask"], 1.0)
    np.testing.assert_array_equal(result["out"], 1.0)
