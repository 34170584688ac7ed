# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Properties of all filters; each filter has a test file for its results."""

from pathlib import Path

import numpy as np
import pytest
from filter_cases import (
    EVERY_FILTER,
    HEIGHTS_TO_HEIGHTS,
    HEIGHTS_TO_LAYER,
    LAYERS,
    OF_ANY_MAP,
    OF_THEIR_LAYERS,
    TO_OUT,
    filtered,
    ground,
    run,
    step_of,
    terrain,
)
from hypothesis import given, settings

from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_filters_py import FILTERS, FilterError
from grid_map_filters_py._registry import BUILT_IN


def each(filters, width):
    """Parametrise on filters; their names and parameters are cut off to make short ids."""
    return pytest.mark.parametrize(
        ("type_name", "params"), filters, ids=lambda value: str(value)[:width]
    )


each_from_heights = each(HEIGHTS_TO_LAYER, 40)
ignore_warnings = pytest.mark.filterwarnings("ignore::grid_map_filters_py.FilterWarning")


def run_here_and_elsewhere(type_name, grid_map, **params):
    """Return the result, having asserted that it depends on the world alone, and changes nothing.

    Elsewhere is in the buffer, at another start index.
    """
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


def test_every_registered_filter_is_among_those_that_are_tested_together():
    assert {type_name for type_name, _ in EVERY_FILTER} == {*FILTERS.types}


def test_every_built_in_filter_has_tests_of_its_own():
    names = {
        f"test{filter_class.__module__.split('.')[-1]}.py" for filter_class in BUILT_IN.values()
    }
    assert len(names) == len(BUILT_IN)
    assert names <= {path.name for path in Path(__file__).parent.iterdir()}


EXTREMES = {
    "nothing": [np.nan],
    "infinite": [np.inf, -np.inf],
    "mixed": [1.0, np.nan, -np.inf, 0.25, np.inf, -3.0, np.nan],
    "huge": [3e38, -3e38, 1e-45],
}


@ignore_warnings
@pytest.mark.parametrize("size", [(1, 1), (1, 6), (7, 1), (5, 4)], ids=str)
@pytest.mark.parametrize("values", EXTREMES.values(), ids=EXTREMES)
def test_every_filter_works_on_maps_of_one_cell_or_row_without_data_or_with_infinities(
    size, values
):
    for type_name, params in EVERY_FILTER:
        grid_map = terrain(size, **{name: np.resize(values, size) for name in LAYERS})
        run_here_and_elsewhere(type_name, grid_map, **params)


@ignore_warnings
@each(OF_ANY_MAP + OF_THEIR_LAYERS, 60)
@given(grid_maps(LAYERS, max_side=7))
@settings(max_examples=25)
def test_every_filter_leaves_its_input_alone_and_gives_the_same_on_a_moved_map(
    type_name, params, grid_map
):
    result = run_here_and_elsewhere(type_name, grid_map, **params)
    for layer in result:
        assert result[layer].dtype == np.float32
        assert result[layer].flags.f_contiguous
        assert not any(np.shares_memory(result[layer], grid_map[name]) for name in grid_map)


@each(OF_THEIR_LAYERS, 60)
def test_a_filter_on_a_map_without_its_layer_names_the_layers_there_are(type_name, params):
    with pytest.raises(FilterError, match="available: only"):
        run(type_name, terrain(only=0.0), **params)


# --- filters that make one layer of heights -------------------------------------------------------


@ignore_warnings
@each_from_heights
@given(grid_maps(("elevation", "other"), max_side=7))
@settings(max_examples=25)
def test_a_filter_leaves_its_input_alone_and_gives_the_same_on_a_moved_map(
    type_name, params, grid_map
):
    result = run_here_and_elsewhere(type_name, grid_map, **TO_OUT | params)
    assert result["out"].dtype == np.float32
    assert result["out"].flags.f_contiguous
    assert result.basic_layers == grid_map.basic_layers


@each_from_heights
def test_a_filter_may_write_over_its_input_layer(type_name, params):
    heights = np.random.default_rng(3).normal(size=(8, 6))
    heights[2:4, 3] = np.nan
    grid_map, onto_itself = ground(heights), dict.fromkeys(TO_OUT, "elevation")
    result = run(type_name, grid_map, **onto_itself, **params)
    np.testing.assert_array_equal(result["elevation"], filtered(type_name, grid_map, **params))


@ignore_warnings
@each_from_heights
@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (5, 4)])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_nothing_comes_from_a_map_without_a_finite_cell(type_name, params, shape, value):
    assert not np.isfinite(filtered(type_name, ground(np.full(shape, value)), **params)).any()


@each_from_heights
def test_what_is_missing_does_not_spread(type_name, params):
    """Infinite, NaN, beyond the border: all the same, and none a height of 0."""
    heights = 1000.0 + np.random.default_rng(5).normal(size=(9, 8))
    heights[4, 4] = np.nan
    result = filtered(type_name, ground(heights), **params)
    heights[4, 4] = np.inf
    np.testing.assert_array_equal(
        np.isfinite(result), np.isfinite(filtered(type_name, ground(heights), **params))
    )
    finite = np.isfinite(heights)
    if type_name.endswith("SlopeFilter") and not params:
        # The slope to four neighbours needs all but one.
        finite[[0, -1]] = finite[:, [0, -1]] = False
    assert np.isfinite(result[finite]).all()
    if (type_name, params) in HEIGHTS_TO_HEIGHTS:
        assert np.nanmin(result) > 990
    else:
        assert np.nanmax(result) < 10


@each_from_heights
def test_an_unknown_layer_is_named(type_name, params):
    with pytest.raises(FilterError, match="no layer 'elevation'; available: only"):
        filtered(type_name, terrain(only=0.0), **params)


# --- filters that smooth --------------------------------------------------------------------------

SMOOTHING = [
    ("gridMapFilters/GaussianBlurFilter", {"sigma": 0.3}),
    ("gridMapFilters/BilateralFilter", {"sigma_space": 0.3, "sigma_range": 1.0}),
]


def test_a_constant_stays_constant_at_borders_and_holes():
    heights = np.full((20, 15), 1234.5)
    heights[5:9, 3:11] = np.nan
    for type_name, params in SMOOTHING:
        smooth = filtered(type_name, ground(heights), **params)
        np.testing.assert_allclose(smooth, heights, rtol=1e-7)


@pytest.mark.parametrize(("type_name", "params"), SMOOTHING)
def test_a_huge_value_spoils_only_its_surroundings(type_name, params):
    heights = np.ones((40, 40), dtype=np.float32)
    heights[5, 5], heights[5, 6] = 3e38, -3e38
    result = filtered(type_name, ground(heights), **params)
    np.testing.assert_array_equal(result[20:, :], 1.0)
    assert np.isfinite(result).all()
