# SPDX-License-Identifier: BSD-3-Clause
"""The filters with weighted means and medians, against loops over cells."""

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import (
    CELLS,
    TO_OUT,
    assert_cells_are,
    filtered,
    ground,
    points_in_disc,
    run,
    terrain,
)
from hypothesis import given, settings, strategies as st

from grid_map_core_py.testing import grid_maps
from grid_map_filters_py.parts._medians import put_window_medians

PLAIN_MAPS = grid_maps(allow_moved=False)


@given(PLAIN_MAPS, st.floats(0.3, 2.0), st.floats(0.1, 1e3), st.sampled_from([None, 1.0, 2.5]))
@settings(max_examples=40)
def test_bilateral_weighs_by_distance_and_by_difference(grid_map, sigma, sigma_range, radius):
    sigma *= grid_map.resolution
    radius = None if radius is None else radius * grid_map.resolution
    reach = 3 * sigma if radius is None else radius
    params = {"sigma_space": sigma, "sigma_range": sigma_range, "radius": radius}
    heights = grid_map["elevation"].astype(np.float64)

    def mean(index):
        if not np.isfinite(heights[index]):
            return np.nan
        points = points_in_disc(grid_map, index, reach)
        distances = np.linalg.norm(points[:, :2] - grid_map.get_position(index), axis=1)
        differences = points[:, 2] - heights[index]
        exponents = (distances / sigma) ** 2 + (differences / sigma_range) ** 2
        return np.average(points[:, 2], weights=np.exp(-0.5 * exponents))

    assert_cells_are(filtered("Bilateral", grid_map, **params), mean, rtol=1e-4, atol=1e-3)


@given(PLAIN_MAPS, st.floats(0.3, 3.0), st.sampled_from([None, 0.0, 1.0, 2.5]), st.booleans())
@settings(max_examples=40)
def test_gaussian_blur_is_the_weighted_mean_of_the_finite_cells(grid_map, sigma, radius, fill):
    sigma *= grid_map.resolution
    radius = None if radius is None else radius * grid_map.resolution
    reach = 3 * sigma if radius is None else radius
    params = {"sigma": sigma, "radius": radius, "compute_empty_cells": fill}
    rows, columns = np.indices(grid_map.size) * grid_map.resolution
    heights = grid_map["elevation"].astype(np.float64)
    finite = np.isfinite(heights)

    def mean(index):
        across, along = rows - rows[index], columns - columns[index]
        used = finite & (np.maximum(np.abs(across), np.abs(along)) <= reach + 1e-9)
        if not used.any() or not (fill or finite[index]):
            return np.nan
        weights = np.exp(-(across**2 + along**2) / (2 * sigma**2))
        return np.average(heights[used], weights=weights[used])

    assert_cells_are(filtered("GaussianBlur", grid_map, **params), mean, rtol=1e-5, atol=1e-4)


@given(PLAIN_MAPS, CELLS)
@settings(max_examples=60)
def test_mean_equals_a_loop_over_discs(grid_map, cells):
    radius = cells * grid_map.resolution
    result = filtered("MeanInRadius", grid_map, radius=radius)
    expected = oracles.mean_in_radius(grid_map["elevation"], grid_map.resolution, radius)
    np.testing.assert_allclose(result, expected, rtol=1e-5, atol=1e-3)


def test_mean_in_radius_keeps_small_differences_on_high_ground():
    heights = np.random.default_rng(1).normal(size=(30, 20)).astype(np.float32) * 0.01
    low = filtered("MeanInRadius", ground(heights), radius=0.35)
    high = filtered("MeanInRadius", ground(heights + np.float32(2000)), radius=0.35)
    np.testing.assert_allclose(high - 2000, low, atol=3e-4)


# --- MedianFill -----------------------------------------------------------------------------------


def median_fill(grid_map, **params):
    defaults = {**TO_OUT, "fill_hole_radius": 0.2, "fill_mask_layer": "mask"}
    return run("MedianFill", grid_map, **defaults | params)


@given(PLAIN_MAPS, st.integers(0, 5), st.booleans())
@settings(max_examples=40)
def test_holes_of_the_closed_mask_are_filled(grid_map, iterations, existing):
    layer, resolution = grid_map["elevation"], grid_map.resolution
    result = median_fill(
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
    result = median_fill(grid_map, debug=True, debug_infill_mask_layer="opened")
    assert result.layers == ("elevation", "mask", "out")
    np.testing.assert_array_equal(result["mask"], grid_map["mask"])
    np.testing.assert_array_equal(result["out"], [[4, 1, 2], [np.nan, 3, 4], [5, 6, 4]])


def test_huge_number_of_iterations_closes_everything():
    grid_map = terrain((20, 20), elevation=np.nan)
    grid_map["elevation"][3:6, 3:6] = 1.0
    result = median_fill(grid_map, num_erode_dilation_iterations=2**31, fill_hole_radius=1e9)
    np.testing.assert_array_equal(result["mask"], 1.0)
    np.testing.assert_array_equal(result["out"], 1.0)


def medians_of(layer, cells, half_width):
    output = np.full(layer.shape, -99, np.float32, order="F")
    put_window_medians(output, layer, cells, half_width)
    return output


@pytest.mark.parametrize("share", [0.1, 0.6, 1.0])
@pytest.mark.parametrize("half_width", [0, 1, 2, 3, 5, 30])
@pytest.mark.parametrize("missing", [0.0, 0.2, 0.95, 1.0])
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (14, 11), (13, 6)], ids=str)
def test_medians_equal_a_loop_over_cells(size, missing, half_width, share):
    random = np.random.default_rng(sum(size) + half_width)
    # Only 18 different values, so that many are equal.
    layer = np.asfortranarray(random.integers(-9, 9, size).astype(np.float32))
    holes = random.random(size) < missing
    layer[holes] = random.choice([np.nan, np.inf, -np.inf], size)[holes]
    cells = np.asfortranarray(random.random(size) < share)
    medians = medians_of(layer, cells, half_width)
    for cell in np.ndindex(size):
        expected = -99.0
        if cells[cell]:
            expected = oracles.upper_median(oracles.in_square(layer, half_width, *cell))
        np.testing.assert_array_equal(medians[cell], expected)


def test_medians_do_not_depend_on_the_pieces():
    layer = np.random.default_rng(1).normal(size=(301, 257)).astype(np.float32, order="F")
    layer[::7, ::3] = np.nan
    everywhere = np.ones(layer.shape, dtype=bool, order="F")
    few = np.zeros_like(everywhere)
    few[5::40, 3::30] = True
    for half_width in (2, 6):
        medians = medians_of(layer, everywhere, half_width)
        np.testing.assert_array_equal(medians[few], medians_of(layer, few, half_width)[few])
