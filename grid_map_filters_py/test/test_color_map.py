# SPDX-License-Identifier: BSD-3-Clause
"""The filter `ColorMap`: a linear ramp of colors."""

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import assert_bytes_near, run, terrain

from grid_map_core_py.testing import assert_maps_equal
from grid_map_filters_py import FilterConfigError

LAYERS = {"input_layer": "a", "output_layer": "color"}
RAMP = {
    "min_value": -1.0,
    "max_value": 3.0,
    "min_color": [0.0, 1.0, 0.25],
    "max_color": [1.0, 0.0, 0.5],
}


def color_map(grid_map, **params):
    return run("gridMapFilters/ColorMapFilter", grid_map, **LAYERS, **params)


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


def test_two_spellings_of_one_parameter_are_refused():
    with pytest.raises(FilterConfigError, match="'min_value' is given twice"):
        color_map(terrain(a=0.0), **RAMP, **{"min/value": 2.0})
