# SPDX-License-Identifier: BSD-3-Clause
"""The filters that compute colors."""

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import assert_bytes_near, run, terrain
from hypothesis import given, settings, strategies as st

from grid_map_core_py import color_vector_to_value
from grid_map_core_py.testing import assert_maps_equal
from grid_map_filters_py import FilterConfigError

# --- ColorBlending --------------------------------------------------------------------------------


def blend(below, above, **params):
    grid_map = terrain(below.shape, below=below, above=above)
    layers = {"background_layer": "below", "foreground_layer": "above", "output_layer": "out"}
    return run("ColorBlending", grid_map, **layers, **params)["out"]


@pytest.mark.parametrize("mode", ["normal", "hard_light", "soft_light"])
@given(opacity=st.floats(0, 1), seed=st.integers(0, 1000))
@settings(max_examples=20)
def test_blend_modes_equal_a_loop_over_cells(mode, opacity, seed):
    random = np.random.default_rng(seed)
    below, above = (color_vector_to_value(random.random((6, 4, 3))) for _ in range(2))
    result = blend(below, above, blend_mode=mode, opacity=opacity)
    for cell in np.ndindex(result.shape):
        channels = oracles.blend(below[cell], above[cell], mode, opacity)
        assert_bytes_near(result[cell], channels)


def test_default_mode_is_normal_and_opacity_is_checked():
    black, white = (color_vector_to_value([[[value] * 3]]) for value in (0.0, 1.0))
    assert oracles.to_bytes(blend(black, white, opacity=0.5)[0, 0]) == (127,) * 3
    for opacity in (-0.1, 1.5, np.nan):
        with pytest.raises(FilterConfigError, match=r"'opacity': expected a number in \[0, 1\]"):
            blend(black, white, opacity=opacity)


# --- ColorFill, ColorMap --------------------------------------------------------------------------


def test_color_fills_all_cells_or_finite_cells_of_mask():
    grid_map = terrain((1, 4), mask=[[1, np.nan, np.inf, -3]])
    params = {"red": 0.2, "green": 1e300, "blue": -1, "output_layer": "color"}
    everywhere = run("ColorFill", grid_map, **params)["color"]
    assert {oracles.to_bytes(color) for color in everywhere.flat} == {(51, 255, 0)}
    masked = run("ColorFill", grid_map, mask_layer="mask", **params)["color"][0]
    np.testing.assert_array_equal(np.isnan(masked), [False, True, True, False])
    assert {oracles.to_bytes(color) for color in masked[[0, 3]]} == {(51, 255, 0)}
    with pytest.raises(FilterConfigError, match="'red, green, blue': expected three finite"):
        run("ColorFill", grid_map, **params | {"red": np.nan})


RAMP = {
    "min_value": -1.0,
    "max_value": 3.0,
    "min_color": [0.0, 1.0, 0.25],
    "max_color": [1.0, 0.0, 0.5],
}


def color_map(grid_map, **params):
    return run("ColorMap", grid_map, input_layer="a", output_layer="color", **params)


def test_ramp_is_linear_and_constant_beyond_its_ends():
    values = np.array([[-np.inf, np.nan, -9, -1, 0, 1, 2.5, 3, 9, np.inf]])
    colors = color_map(terrain(values.shape, a=values), **RAMP)["color"][0]
    assert np.isnan(colors[[0, 1, 9]]).all()
    assert oracles.to_bytes(colors[2]) == oracles.to_bytes(colors[3]) == (0, 255, 63)
    assert oracles.to_bytes(colors[7]) == oracles.to_bytes(colors[8]) == (255, 0, 127)
    for number in (4, 5, 6):
        share = (values[0, number] + 1) / 4
        assert_bytes_near(colors[number], 255 * np.array([share, 1 - share, (1 + share) / 4]))


@pytest.mark.parametrize(
    "spelling",
    [
        {"min": {"value": -1, "color": [0, 1, 0.25]}, "max": {"value": 3, "color": [1, 0, 0.5]}},
        {"min/value": -1, "min/color": [0, 1, 0.25], "max/value": 3.0, "max/color": [1, 0, 0.5]},
        {"min.value": -1, "min": {"color": [0, 1, 0.25]}, "max_value": 3}
        | {"max/color": [1, 0, 0.5]},
    ],
    ids=["nested", "ROS 1", "mixed"],
)
def test_nested_flat_and_field_parameters_are_equal(spelling):
    grid_map = terrain((4, 3), a=np.linspace(-2, 4, 12).reshape(4, 3))
    assert_maps_equal(color_map(grid_map, **spelling), color_map(grid_map, **RAMP))
    with pytest.raises(FilterConfigError, match="'min_value' is given twice"):
        color_map(grid_map, **RAMP, **{"min/value": 2.0})


# --- LightIntensity, NormalColorMap ---------------------------------------------------------------

NORMALS = {"input_layers_prefix": "n_", "output_layer": "color"}


def test_light_is_brightest_at_normal_incidence():
    normals = {"n_x": [[0, 1, 0, 0.6, np.nan]], "n_y": 0.0, "n_z": [[1, 0, -1, 0.8, 1]]}
    grid_map = terrain((1, 5), **normals)
    for length in (1e-200, 7, 1e200):
        light = {"light_direction": [0, 0, -length]}
        color = run("LightIntensity", grid_map, **light, **NORMALS)["color"][0]
        expected = [(255,) * 3, (0,) * 3, (0,) * 3, (204,) * 3]
        assert [oracles.to_bytes(one) for one in color[:4]] == expected
        assert np.isnan(color[4])
    for direction in ([0, 0, 0], [1, 2], [0, 0, np.inf]):
        with pytest.raises(FilterConfigError, match="'light_direction': expected three finite"):
            run("LightIntensity", grid_map, light_direction=direction, **NORMALS)
