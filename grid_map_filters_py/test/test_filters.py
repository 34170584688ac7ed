# SPDX-License-Identifier: BSD-3-Clause
"""Properties of all filters; each filter has a test file for its results."""

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import (
    CELLS,
    EVERY_FILTER,
    HEIGHTS_TO_HEIGHTS,
    HEIGHTS_TO_LAYER,
    LAYERS,
    OF_ANY_MAP,
    STEPS,
    TO_OUT,
    filtered,
    ground,
    run,
    step_of,
    terrain,
)
from hypothesis import given, settings, strategies as st

from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_filters_py import (
    FilterConfigError,
    FilterError,
)
from grid_map_filters_py._registry import FILTERS


def each(filters, width):
    """Parametrize on filters, with short ids."""
    return pytest.mark.parametrize(
        ("type_name", "params"), filters, ids=lambda value: str(value)[:width]
    )


each_from_heights = each(HEIGHTS_TO_LAYER, 40)
ignore_warnings = pytest.mark.filterwarnings("ignore::grid_map_filters_py.FilterWarning")


def run_here_and_elsewhere(type_name, grid_map, **params):
    """Return the result; assert that it does not depend on the start index and changes no input."""
    before, elsewhere = grid_map.copy(), tuple(np.subtract(grid_map.size, 1) // 2)
    result = run(type_name, grid_map, **params)
    again = run(type_name, moved_in_buffer(grid_map, elsewhere), **params)
    assert_maps_equal(grid_map, before)
    assert grid_map.start_index == before.start_index
    assert_maps_equal(again, result)
    moved = moved_in_buffer(grid_map, elsewhere)
    called = step_of(type_name, **params).filter(moved)
    assert_maps_equal(called, result)
    assert_maps_equal(moved, before)
    return result


def test_every_registered_filter_is_in_the_common_tests():
    assert {FILTERS[name] for name, _ in EVERY_FILTER} == {FILTERS[name] for name in FILTERS.types}


EXTREMES = {
    "nothing": [np.nan],
    "infinite": [np.inf, -np.inf],
    "mixed": [1.0, np.nan, -np.inf, 0.25, np.inf, -3.0, np.nan],
    "huge": [3e38, -3e38, 1e-45],
}


@ignore_warnings
@pytest.mark.parametrize("size", [(1, 1), (1, 6), (7, 1), (5, 4)], ids=str)
@pytest.mark.parametrize("values", EXTREMES.values(), ids=EXTREMES)
def test_filters_work_on_tiny_empty_and_extreme_maps(size, values):
    for type_name, params in EVERY_FILTER:
        grid_map = terrain(size, **{name: np.resize(values, size) for name in LAYERS})
        run_here_and_elsewhere(type_name, grid_map, **params)


@ignore_warnings
@each(EVERY_FILTER, 60)
@given(grid_maps(LAYERS, max_side=7))
@settings(max_examples=25)
def test_filters_change_no_input_and_work_on_moved_maps(type_name, params, grid_map):
    result = run_here_and_elsewhere(type_name, grid_map, **params)
    for layer in result:
        assert result[layer].dtype == np.float32
        assert result[layer].flags.f_contiguous
        assert not any(np.shares_memory(result[layer], grid_map[name]) for name in grid_map)
    if type_name in ("MedianFill", "SetBasicLayers", "Deletion"):
        return
    assert result.basic_layers == grid_map.basic_layers


@each([entry for entry in EVERY_FILTER if entry not in OF_ANY_MAP], 60)
def test_missing_layer_is_named_with_available_layers(type_name, params):
    with pytest.raises(FilterError, match=r"no layer '.*'; available: only"):
        run(type_name, terrain(only=0.0), **params)


IN_DISCS = {"Dilation": max, "Erosion": min, "MinInRadius": min}


@pytest.mark.parametrize("type_name", IN_DISCS)
@given(grid_maps(allow_moved=False), CELLS, st.booleans())
@settings(max_examples=40)
def test_extremes_in_discs_equal_a_loop_over_cells(type_name, grid_map, cells, fill):
    radius = cells * grid_map.resolution
    params = {} if type_name == "MinInRadius" else {"compute_empty_cells": fill}
    result = filtered(type_name, grid_map, radius=radius, **params)
    layer, fill = grid_map["elevation"], any(params.values())
    expected = oracles.extreme_in_disc(
        IN_DISCS[type_name], layer, grid_map.resolution, radius, fill=fill
    )
    np.testing.assert_array_equal(result, expected)


HUGE_DISCS = {
    "Bilateral": ({"sigma_space": 1e6, "sigma_range": 1e6}, 34.5),
    "Dilation": ({"radius": 1e6}, 69),
    "Erosion": ({"radius": 1e6}, 0),
    "GaussianBlur": ({"sigma": 1e6}, 34.5),
    "MeanInRadius": ({"radius": 1e6}, 34.5),
}


@pytest.mark.parametrize("type_name", HUGE_DISCS)
def test_a_disc_larger_than_the_map_covers_it(type_name):
    params, expected = HUGE_DISCS[type_name]
    np.testing.assert_allclose(filtered(type_name, ground(STEPS), **params), expected, rtol=1e-6)


BILATERAL = {"sigma_space": 1, "sigma_range": 1}
FILL = {"fill_hole_radius": 0.2, "fill_mask_layer": "mask"}
RAMP = {"min_value": -1, "max_value": 3, "min_color": [0, 0, 0], "max_color": [1, 1, 1]}
SUM = {"expression": "sum(elevation)"}
BELOW = {"set_to": 0, "lower_threshold": 1}
NORMALS = {"output_layer": None, "output_layers_prefix": "n_"}
SCORES = {"input_layer": None, "input_layers": ["elevation"], "critical_values": [1]}
STEP = {"radius": 1, "second_window_radius": 1, "critical_value": 1}

WRONG = [
    ("Bilateral", BILATERAL | {"sigma_space": 0}, "'sigma_space': expected a number > 0"),
    ("Bilateral", BILATERAL | {"sigma_range": 0}, "'sigma_range': expected a number > 0"),
    ("Bilateral", BILATERAL | {"sigma_range": 1e308}, "'sigma_range': expected a number > 0"),
    ("Bilateral", BILATERAL | {"radius": -1}, "'radius': expected a length >= 0"),
    ("ColorMap", RAMP | {"max_value": -1.0}, "'max/value': expected a finite number above "),
    ("ColorMap", RAMP | {"min_value": -np.inf}, "'min/value': expected a finite number"),
    ("ColorMap", RAMP | {"min_color": [0, 1]}, "'min/color': expected three finite numbers"),
    ("ColorMap", RAMP | {"min_value": -3e38, "max_value": 3e38}, "a ramp of at most 3.40282e"),
    ("Dilation", {"radius": -0.1}, "'radius': expected a length >= 0"),
    ("Erosion", {"radius": np.nan}, "'radius': expected a length >= 0"),
    ("GaussianBlur", {"sigma": 0}, "'sigma': expected a length > 0"),
    ("GaussianBlur", {"sigma": 1, "radius": np.nan}, "'radius': expected a length >= 0"),
    ("Inpaint", {"radius": 1, "max_hole_area": -1}, "'max_hole_area': expected an area >= 0"),
    ("MedianFill", FILL | {"fill_hole_radius": -0.1}, "'fill_hole_radius': expected a "),
    ("MedianFill", FILL | {"filter_existing_values": True}, "needs an 'existing_value_radius'"),
    ("MedianFill", FILL | {"existing_value_radius": np.inf}, "'existing_value_radius': expected"),
    ("MedianFill", FILL | {"debug": True}, "needs a 'debug_infill_mask_layer'"),
    ("MedianFill", FILL | {"num_erode_dilation_iterations": -1}, "an integer >= 0, got -1"),
    ("MedianFill", FILL | {"fill_mask_layer": "out"}, "expected different 'output_layer'"),
    ("MeanInRadius", {"radius": -1}, "'radius': expected a length >= 0 [m], got -1.0"),
    ("NormalVectors", NORMALS | {"normal_vector_positive_axis": "w"}, "one of 'x', 'y', 'z', got"),
    ("Inpaint", {"radius": np.nan}, "'radius': expected a length >= 0 [m], got nan"),
    ("Roughness", {"radius": np.inf}, "'radius': expected a length >= 0"),
    ("Slope", {"radius": -1}, "'radius': expected a length >= 0"),
    ("Slope", {"input_layers_prefix": "n_"}, "exactly one of 'input_layer' and"),
    ("SlidingWindowMathExpression", SUM | {"window_size": 4}, "an odd number of cells, got 4"),
    ("SlidingWindowMathExpression", SUM | {"window_length": 0.0}, "a length > 0 [m], got 0.0"),
    ("SlidingWindowMathExpression", {"expression": "sum(c)"}, "no layer but the input layer 'elev"),
    ("StepHeight", {"radius": -1}, "'radius': expected a length >= 0"),
    ("StepHeight", {"radius": 1, "critical_value": 1}, "both or none of 'second_window_radius',"),
    ("StepHeight", STEP | {"second_window_radius": -1}, "'second_window_radius': expected a "),
    ("StepHeight", STEP | {"critical_value": -1}, "'critical_value': expected a height >= 0"),
    ("StepHeight", STEP | {"critical_cell_number": 0}, "'critical_cell_number': expected"),
    ("Threshold", {"layer": "a", "set_to": 0}, "exactly one of 'lower_threshold' and"),
    ("Threshold", BELOW | {"output_layer": "a"}, "either 'layer', or 'condition_layer'"),
    ("Threshold", BELOW | {"layer": "a", "output_layer": "b"}, "either 'layer', or 'condition_"),
    ("Traversability", SCORES | {"input_layers": []}, "'input_layers': expected at least one"),
    ("Traversability", SCORES | {"critical_values": [1, 2]}, "expected 1 numbers, one per layer"),
    ("Traversability", SCORES | {"critical_values": [0]}, "'critical_values': expected numbers >"),
    ("Traversability", SCORES | {"weights": [1, 1]}, "'weights': expected 1 numbers"),
    ("Traversability", SCORES | {"weights": [-1]}, "'weights': expected numbers >= 0"),
    ("Traversability", SCORES | {"weights": [0]}, "'weights': expected a number > 0"),
]


@pytest.mark.parametrize(("type_name", "params", "message"), WRONG)
def test_wrong_parameters_are_refused(type_name, params, message):
    defaults = {} if type_name == "Threshold" else TO_OUT
    given = {name: value for name, value in (defaults | params).items() if value is not None}
    with pytest.raises(FilterConfigError) as caught:
        step_of(type_name, **given)
    assert message in str(caught.value)


# --- filters that make one layer of heights -------------------------------------------------------


@each_from_heights
def test_output_may_replace_the_input_layer(type_name, params):
    heights = np.random.default_rng(3).normal(size=(8, 6))
    heights[2:4, 3] = np.nan
    grid_map, onto_itself = ground(heights), dict.fromkeys(TO_OUT, "elevation")
    result = run(type_name, grid_map, **onto_itself, **params)
    np.testing.assert_array_equal(result["elevation"], filtered(type_name, grid_map, **params))


@each_from_heights
def test_missing_values_do_not_spread(type_name, params):
    """Infinities, NaN and cells beyond the border are treated alike, and not as a height of 0."""
    heights = 1000.0 + np.random.default_rng(5).normal(size=(9, 8))
    heights[4, 4] = np.nan
    result = filtered(type_name, ground(heights), **params)
    heights[4, 4] = np.inf
    np.testing.assert_array_equal(
        np.isfinite(result), np.isfinite(filtered(type_name, ground(heights), **params))
    )
    finite = np.isfinite(heights)
    if (type_name, params) == ("Slope", {}):
        # Border cells lack some of their four neighbors.
        finite[[0, -1]] = finite[:, [0, -1]] = False
    assert np.isfinite(result[finite]).all()
    if (type_name, params) in HEIGHTS_TO_HEIGHTS:
        assert np.nanmin(result) > 990
    else:
        assert np.nanmax(result) < 10


# --- filters that smooth --------------------------------------------------------------------------

SMOOTHING = [
    ("GaussianBlur", {"sigma": 0.3}),
    ("Bilateral", {"sigma_space": 0.3, "sigma_range": 1.0}),
]


def test_constants_stay_constant_at_borders_and_holes():
    heights = np.full((20, 15), 1234.5)
    heights[5:9, 3:11] = np.nan
    for type_name, params in SMOOTHING:
        smooth = filtered(type_name, ground(heights), **params)
        np.testing.assert_allclose(smooth, heights, rtol=1e-7)


@pytest.mark.parametrize(("type_name", "params"), [*SMOOTHING, ("MeanInRadius", {"radius": 0.6})])
def test_a_huge_value_spoils_only_its_surroundings(type_name, params):
    heights = np.ones((40, 40), dtype=np.float32)
    heights[5, 5], heights[5, 6] = 3e38, -3e38
    result = filtered(type_name, ground(heights), **params)
    np.testing.assert_array_equal(result[20:, :], 1.0)
    assert np.isfinite(result).all()
