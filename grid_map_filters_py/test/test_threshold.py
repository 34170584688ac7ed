# SPDX-License-Identifier: BSD-3-Clause
"""The filter `Threshold`."""

from functools import partial

import numpy as np
import pytest
from filter_cases import run, terrain

from grid_map_filters_py import FilterError

threshold = partial(run, "gridMapFilters/ThresholdFilter")


def test_finite_values_below_or_above_are_set():
    values = np.array([[1, 2, 3, np.nan, np.inf, -np.inf]], dtype=np.float32)
    grid_map = terrain((1, 6), a=values)
    lower = threshold(grid_map, layer="a", lower_threshold=2, set_to=0)["a"]
    np.testing.assert_array_equal(lower, [[0, 2, 3, np.nan, np.inf, -np.inf]])
    upper = threshold(grid_map, layer="a", upper_threshold=2.0, set_to=np.nan)["a"]
    np.testing.assert_array_equal(upper, [[1, 2, np.nan, np.nan, np.inf, -np.inf]])


def test_output_may_differ_from_the_condition_layer():
    grid_map = terrain((1, 3), a=[[1, 2, 3]], b=[[7, 8, 9]])
    params = {"condition_layer": "a", "lower_threshold": 2.5, "set_to": np.inf}
    result = threshold(grid_map, output_layer="b", **params)
    np.testing.assert_array_equal(result["b"], [[np.inf, np.inf, 9]])
    np.testing.assert_array_equal(result["a"], grid_map["a"])
    with pytest.raises(FilterError, match="no layer 'c'; available: a, b"):
        threshold(grid_map, output_layer="c", **params)


def test_threshold_is_compared_in_double_precision():
    grid_map = terrain((1, 2), a=[[0.1, 0.2]])
    # The float32 nearest to 0.1 is larger than 0.1.
    above = threshold(grid_map, layer="a", upper_threshold=0.1, set_to=5)["a"]
    assert above[0, 0] == 5
    huge = threshold(grid_map, layer="a", lower_threshold=1e300, set_to=-1e300)["a"]
    assert (huge == -np.inf).all()
