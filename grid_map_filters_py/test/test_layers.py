# SPDX-License-Identifier: BSD-3-Clause
"""The filters that copy, remove, choose and set layers, and those with expressions."""

import numpy as np
import pytest
from filter_cases import filtered, run, terrain

from grid_map_core_py.testing import assert_maps_equal
from grid_map_filters_py import FilterConfigError, FilterError, FilterWarning
from grid_map_filters_py._builtin import BufferNormalizer


def test_normalized_map_has_start_index_zero():
    grid_map = terrain((3, 2), elevation=[[0, 1], [2, 3], [4, 5]])
    grid_map.start_index = (2, 1)
    for result in (run("BufferNormalizer", grid_map), BufferNormalizer()(grid_map)):
        assert result.start_index == (0, 0)
        np.testing.assert_array_equal(result["elevation"], [[5, 4], [1, 0], [3, 2]])
        assert_maps_equal(result, grid_map)
    assert grid_map.start_index == (2, 1)


def test_copy_has_equal_bits_in_separate_memory():
    values = np.array([[1.5, np.nan, -0.0], [np.inf, 1e-45, -3e38]], dtype=np.float32)
    grid_map = terrain(values.shape, other=1.0, elevation=values)
    for output, layers in (("copy", ("other", "elevation", "copy")), ("other", grid_map.layers)):
        result = run("Duplication", grid_map, input_layer="elevation", output_layer=output)
        assert result.layers == layers
        np.testing.assert_array_equal(result[output].view(np.uint32), values.view(np.uint32))
        result[output][0, 0] = 7.0
        assert result["elevation"][0, 0] == 1.5
    assert (grid_map["other"] == 1.0).all()


def test_deleting_a_missing_layer_is_a_warning():
    grid_map = terrain(a=1.0, b=2.0)
    grid_map.basic_layers = ["a"]
    with pytest.warns(FilterWarning, match=r"filter 1 'under_test'.*no layer nope to delete"):
        result = run("Deletion", grid_map, layers=["a", "nope"])
    assert (result.layers, result.basic_layers) == (("b",), ())


def test_missing_basic_layers_are_a_warning():
    grid_map = terrain(a=1.0, b=2.0, c=3.0)
    grid_map.basic_layers = ["c"]
    for name in ("layers", "layer"):
        with pytest.warns(FilterWarning, match="no layer nope to be basic; available: a, b, c"):
            result = run("SetBasicLayers", grid_map, **{name: ["b", "nope", "a"]})
        assert result.basic_layers == ("b", "a")
    assert run("SetBasicLayers", grid_map, layers=None).basic_layers == ()
    for params in ({}, {"layers": ["a"], "layer": ["b"]}):
        with pytest.raises(FilterConfigError, match="expected either 'layers' or 'layer'"):
            run("SetBasicLayers", grid_map, **params)


# --- Threshold ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "params", "expected"),
    [
        (
            [1, 2, 3, np.nan, np.inf, -np.inf],
            {"lower_threshold": 2, "set_to": 0},
            [0, 2, 3, np.nan, np.inf, -np.inf],
        ),
        (
            [1, 2, 3, np.nan, np.inf, -np.inf],
            {"upper_threshold": 2.0, "set_to": np.nan},
            [1, 2, np.nan, np.nan, np.inf, -np.inf],
        ),
        # Double precision: the float32 nearest to 0.1 is larger than 0.1.
        ([0.1, -1], {"upper_threshold": 0.1, "set_to": 5}, [5, -1]),
        ([0.1, -1], {"lower_threshold": 1e300, "set_to": -1e300}, [-np.inf, -np.inf]),
    ],
)
def test_finite_values_below_or_above_are_set(values, params, expected):
    result = run("Threshold", terrain((1, len(values)), a=[values]), layer="a", **params)
    np.testing.assert_array_equal(result["a"], [expected])


def test_output_may_differ_from_the_condition_layer():
    grid_map = terrain((1, 3), a=[[1, 2, 3]], b=[[7, 8, 9]])
    params = {"condition_layer": "a", "lower_threshold": 2.5, "set_to": np.inf}
    result = run("Threshold", grid_map, output_layer="b", **params)
    np.testing.assert_array_equal(result["b"], [[np.inf, np.inf, 9]])
    np.testing.assert_array_equal(result["a"], grid_map["a"])
    with pytest.raises(FilterError, match="no layer 'c'; available: a, b"):
        run("Threshold", grid_map, output_layer="c", **params)


# --- MathExpression, SlidingWindowMathExpression; test_expression*.py test the language -----------


def test_number_fills_layer_and_wrong_shape_is_refused():
    grid_map = terrain((4, 3), a=2.0)
    result = run("MathExpression", grid_map, expression="sum(a)", output_layer="out")
    np.testing.assert_array_equal(result["out"], np.full((4, 3), 24.0))
    with pytest.raises(FilterError, match=r"\(3, 4\); expected a scalar or the map's \(4, 3\)"):
        run("MathExpression", grid_map, expression="transpose(a)", output_layer="out")


@pytest.mark.parametrize(
    ("length", "cells"), [(0.05, 1), (0.3, 3), (0.16, 3), (0.24, 3), (0.25, 3), (0.36, 5)]
)
def test_window_length_is_rounded_to_an_odd_number(length, cells):
    counts = filtered(
        "SlidingWindowMathExpression",
        terrain((11, 9), elevation=1.0),
        expression="numberOfFinites(elevation)",
        window_length=length,
        edge_handling="crop",
    )
    assert counts[5, 4] == cells**2
