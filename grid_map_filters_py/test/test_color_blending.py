# SPDX-License-Identifier: BSD-3-Clause
"""The filter `ColorBlending`, against a loop over cells."""

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import assert_bytes_near, run, terrain
from hypothesis import given, settings, strategies as st

from grid_map_core_py import color_vector_to_value
from grid_map_filters_py import FilterConfigError

each_mode = pytest.mark.parametrize("mode", ["normal", "hard_light", "soft_light"])


def blend(below, above, **params):
    grid_map = terrain(below.shape, below=below, above=above)
    layers = {"background_layer": "below", "foreground_layer": "above", "output_layer": "out"}
    return run("gridMapFilters/ColorBlendingFilter", grid_map, **layers, **params)["out"]


@each_mode
@given(opacity=st.floats(0, 1), seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_blend_modes_equal_a_loop_over_cells(mode, opacity, seed):
    random = np.random.default_rng(seed)
    below, above = (color_vector_to_value(random.random((6, 4, 3))) for _ in range(2))
    result = blend(below, above, blend_mode=mode, opacity=opacity)
    for cell in np.ndindex(result.shape):
        channels = oracles.blend(below[cell], above[cell], mode, opacity)
        assert_bytes_near(result[cell], channels)


@each_mode
def test_cells_with_one_color_keep_it(mode):
    red, blue = color_vector_to_value([[1.0, 0, 0], [0, 0, 1.0]])
    below, above = np.array([[red, np.nan, np.nan]]), np.array([[np.nan, blue, np.nan]])
    result = blend(below, above, blend_mode=mode, opacity=0.3)
    np.testing.assert_array_equal(result, [[red, blue, np.nan]])


def test_default_mode_is_normal_and_opacity_is_checked():
    black, white = (color_vector_to_value([[[value] * 3]]) for value in (0.0, 1.0))
    assert oracles.to_bytes(blend(black, white, opacity=0.5)[0, 0]) == (127,) * 3
    for opacity in (-0.1, 1.5, np.nan):
        with pytest.raises(FilterConfigError, match=r"'opacity': expected a number in \[0, 1\]"):
            blend(black, white, opacity=opacity)
