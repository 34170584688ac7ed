# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The filters that go beyond those of C++: against naive loops, and what holds for all of them."""

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grid_map_core_py import GridMap, circle_cells
from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_filters_py import FilterChain, FilterConfigError, FilterError, FilterWarning

BILATERAL, BLUR = "gridMapFilters/BilateralFilter", "gridMapFilters/GaussianBlurFilter"
DILATION, EROSION = "gridMapFilters/DilationFilter", "gridMapFilters/ErosionFilter"
ROUGHNESS, SLOPE = "gridMapFilters/RoughnessFilter", "gridMapFilters/SlopeFilter"
STEP_HEIGHT = "gridMapFilters/StepHeightFilter"
TRAVERSABILITY = "gridMapFilters/TraversabilityFilter"
INPAINT = "gridMapCv/InpaintFilter"

TO_OUT = {"input_layer": "elevation", "output_layer": "out"}
CELLS = st.sampled_from([0.0, 0.9, 1.0, 1.5, 2.0, 2.3, 5.0])
"""Radii in cells: below one, on the rim, beyond the map."""

EVERY_FILTER = [
    (BILATERAL, {"sigma_space": 0.1, "sigma_range": 0.5}),
    (BLUR, {"sigma": 0.1}),
    (BLUR, {"sigma": 0.1, "compute_empty_cells": True}),
    (DILATION, {"radius": 0.3}),
    (EROSION, {"radius": 0.3, "compute_empty_cells": True}),
    (ROUGHNESS, {"radius": 0.3}),
    (SLOPE, {}),
    (SLOPE, {"radius": 0.3}),
    (STEP_HEIGHT, {"radius": 0.3}),
    (STEP_HEIGHT, {"radius": 0.3, "second_window_radius": 0.3, "critical_value": 0.2}),
    (INPAINT, {"radius": 0.3, "enclosed_holes_only": True, "max_hole_area": 0.3}),
]


def run(type_name, grid_map, **params):
    """Return the layer `out` of a filter that is applied to the elevation."""
    params = params if "input_layers" in params else TO_OUT | params
    step = {"name": "under_test", "type": type_name, "params": params}
    return FilterChain.from_config([step])(grid_map)["out"]


def terrain(heights, resolution=0.1) -> GridMap:
    heights = np.asarray(heights, dtype=np.float32)
    size = np.multiply(heights.shape, resolution)
    return GridMap(size, resolution, layers={"elevation": heights})


def unwrapped(grid_map: GridMap) -> GridMap:
    grid_map.convert_to_default_start_index()
    return grid_map


def points_in_disc(grid_map, index, radius):
    """The finite 3-D points of a disc, looked up cell by cell."""
    cells = circle_cells(grid_map, grid_map.get_position(index), radius)
    points = [grid_map.get_position3("elevation", cell) for cell in cells]
    return np.array([point for point in points if np.isfinite(point).all()]).reshape(-1, 3)


def assert_cells_are(result, expected, **tolerances):
    """Compare a layer with what a function of the index gives."""
    wanted = [expected(index) for index in np.ndindex(result.shape)]
    np.testing.assert_allclose(result, np.reshape(wanted, result.shape), **tolerances)


# --- all of them ----------------------------------------------------------------------------------

by_filter = pytest.mark.parametrize(
    ("type_name", "params"), EVERY_FILTER, ids=lambda value: str(value)[:40]
)


@by_filter
@given(grid_maps(("elevation", "other"), max_side=7))
@settings(max_examples=25)
def test_a_filter_leaves_its_input_alone_and_gives_the_same_on_a_moved_map(
    type_name, params, grid_map
):
    before = grid_map.copy()
    chain = FilterChain.from_config(
        [{"name": "under_test", "type": type_name, "params": TO_OUT | params}]
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FilterWarning)
        result = chain(grid_map)
        elsewhere = tuple(np.subtract(grid_map.size, 1) // 2)
        again = chain(moved_in_buffer(grid_map, elsewhere))
    assert_maps_equal(grid_map, before)
    assert grid_map.start_index == before.start_index
    assert_maps_equal(again, result)
    assert result["out"].dtype == np.float32
    assert result["out"].flags.f_contiguous
    assert result.basic_layers == grid_map.basic_layers


@by_filter
def test_a_filter_may_write_over_its_input_layer(type_name, params):
    heights = np.random.default_rng(3).normal(size=(8, 6))
    heights[2:4, 3] = np.nan
    grid_map = terrain(heights)
    step = {"name": "a", "type": type_name, "params": {"input_layer": "elevation", **params}}
    step["params"]["output_layer"] = "elevation"
    result = FilterChain.from_config([step])(grid_map)
    np.testing.assert_array_equal(result["elevation"], run(type_name, grid_map, **params))


@by_filter
@pytest.mark.parametrize("shape", [(1, 1), (1, 6), (5, 4)])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_nothing_comes_from_a_map_without_a_finite_cell(type_name, params, shape, value):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FilterWarning)
        result = run(type_name, terrain(np.full(shape, value)), **params)
    assert not np.isfinite(result).any()


@by_filter
def test_what_is_missing_does_not_spread(type_name, params):
    """Infinite, NaN, beyond the border: all the same, and none a height of 0."""
    heights = 1000.0 + np.random.default_rng(5).normal(size=(9, 8))
    heights[4, 4] = np.nan
    result = run(type_name, terrain(heights), **params)
    heights[4, 4] = np.inf
    np.testing.assert_array_equal(
        np.isfinite(result), np.isfinite(run(type_name, terrain(heights), **params))
    )
    finite = np.isfinite(heights)
    if type_name == SLOPE and not params:  # The slope to four neighbours needs all but one.
        finite[[0, -1]] = finite[:, [0, -1]] = False
    assert np.isfinite(result[finite]).all()
    if type_name in (BILATERAL, BLUR, DILATION, EROSION, INPAINT):
        assert np.nanmin(result) > 990
    else:
        assert np.nanmax(result) < 10


@by_filter
def test_an_unknown_layer_is_named(type_name, params):
    grid_map = GridMap((1, 1), 0.1, layers={"only": 0.0})
    with pytest.raises(FilterError, match="no layer 'elevation'; available: only"):
        run(type_name, grid_map, **params)


@pytest.mark.parametrize(
    ("type_name", "params", "message"),
    [
        (BILATERAL, {"sigma_space": 0, "sigma_range": 1}, "'sigma_space': expected a number > 0"),
        (BILATERAL, {"sigma_space": 1, "sigma_range": 0}, "'sigma_range': expected a number > 0"),
        (
            BILATERAL,
            {"sigma_space": 1, "sigma_range": 1, "radius": -1},
            "'radius': expected a length >= 0",
        ),
        (BLUR, {"sigma": 0}, "'sigma': expected a length > 0"),
        (BLUR, {"sigma": math.inf}, "'sigma': expected a length > 0"),
        (BLUR, {"sigma": 1, "radius": math.nan}, "'radius': expected a length >= 0"),
        (DILATION, {"radius": -0.1}, "'radius': expected a length >= 0"),
        (EROSION, {"radius": math.nan}, "'radius': expected a length >= 0"),
        (ROUGHNESS, {"radius": math.inf}, "'radius': expected a length >= 0"),
        (SLOPE, {"radius": -1}, "'radius': expected a length >= 0"),
        (SLOPE, {"input_layers_prefix": "n_"}, "exactly one of 'input_layer' and"),
        (STEP_HEIGHT, {"radius": -1}, "'radius': expected a length >= 0"),
        (
            STEP_HEIGHT,
            {"radius": 1, "second_window_radius": 1},
            "both or none of 'second_window_radius', 'critical_value'",
        ),
        (
            STEP_HEIGHT,
            {"radius": 1, "second_window_radius": -1, "critical_value": 1},
            "'second_window_radius': expected a length >= 0",
        ),
        (
            STEP_HEIGHT,
            {"radius": 1, "second_window_radius": 1, "critical_value": -1},
            "'critical_value': expected a height >= 0",
        ),
        (STEP_HEIGHT, {"radius": 1, "critical_cell_number": 0}, "'critical_cell_number': expected"),
        (INPAINT, {"radius": 1, "max_hole_area": -1}, "'max_hole_area': expected an area >= 0"),
        (INPAINT, {"radius": 1, "max_hole_area": math.nan}, "'max_hole_area': expected an area"),
    ],
)
def test_a_parameter_that_makes_no_sense_is_refused(type_name, params, message):
    with pytest.raises(FilterConfigError, match=message):
        run(type_name, terrain([[1.0]]), **params)


# --- morphology -----------------------------------------------------------------------------------


@given(grid_maps(), CELLS, st.booleans())
@settings(max_examples=40)
def test_dilation_and_erosion_are_the_extremes_of_the_disc(grid_map, cells, compute_empty_cells):
    grid_map, radius = unwrapped(grid_map), cells * grid_map.resolution
    params = {"radius": radius, "compute_empty_cells": compute_empty_cells}

    def extreme(choose):
        def of_cell(index):
            heights = points_in_disc(grid_map, index, radius)[:, 2]
            wanted = compute_empty_cells or np.isfinite(grid_map["elevation"][index])
            return choose(heights) if heights.size and wanted else np.nan

        return of_cell

    assert_cells_are(run(DILATION, grid_map, **params), extreme(np.max), rtol=0)
    assert_cells_are(run(EROSION, grid_map, **params), extreme(np.min), rtol=0)


def test_a_disc_far_larger_than_the_map_is_the_map():
    grid_map = terrain(np.arange(70.0).reshape(10, 7))
    assert (run(DILATION, grid_map, radius=1e6) == 69).all()
    assert (run(EROSION, grid_map, radius=1e6) == 0).all()
    np.testing.assert_allclose(run(BLUR, grid_map, sigma=1e6), 34.5)
    np.testing.assert_allclose(run(BLUR, grid_map, sigma=1e-6), grid_map["elevation"])
    smooth = run(BILATERAL, grid_map, sigma_space=1e6, sigma_range=1e6)
    np.testing.assert_allclose(smooth, 34.5, rtol=1e-6)
    assert np.isfinite(run(ROUGHNESS, grid_map, radius=1e6)).all()


# --- step height ----------------------------------------------------------------------------------


def step_in_disc(grid_map, index, radius):
    heights = points_in_disc(grid_map, index, radius)[:, 2]
    return np.ptp(heights) if np.isfinite(grid_map["elevation"][index]) else np.nan


@given(grid_maps(), CELLS)
@settings(max_examples=40)
def test_step_height_is_the_largest_difference_in_the_disc(grid_map, cells):
    grid_map, radius = unwrapped(grid_map), cells * grid_map.resolution
    result = run(STEP_HEIGHT, grid_map, radius=radius)
    assert_cells_are(result, lambda index: step_in_disc(grid_map, index, radius), rtol=1e-6)


@given(grid_maps(), CELLS, CELLS, st.integers(1, 8), st.floats(0, 1000, width=16))
@settings(max_examples=40)
def test_a_second_window_weighs_steps_by_the_number_of_their_cells(
    grid_map, first, second, number, critical
):
    grid_map = unwrapped(grid_map)
    first, second = first * grid_map.resolution, second * grid_map.resolution
    params = {"radius": first, "second_window_radius": second}
    result = run(
        STEP_HEIGHT, grid_map, **params, critical_value=critical, critical_cell_number=number
    )
    steps = run(STEP_HEIGHT, grid_map, radius=first)

    def weighed(index):
        cells = circle_cells(grid_map, grid_map.get_position(index), second)
        around = np.array([steps[tuple(cell)] for cell in cells])
        around = around[np.isfinite(around)].astype(np.float64)
        if not around.size:
            return np.nan
        return min(1.0, np.sum(around > critical) / number) * around.max()

    assert_cells_are(result, weighed, rtol=1e-6)


def test_a_spike_is_no_step_but_a_kerb_is():
    spike, kerb = np.zeros((11, 11)), np.zeros((11, 11))
    spike[5, 5] = kerb[5:] = 0.2
    params = {"radius": 0.1, "second_window_radius": 0.1, "critical_value": 0.15}
    # The spike stands out in five discs, the kerb in two cells of every column.
    for heights, number, expected in [(spike, 10, 0.1), (spike, 5, 0.2), (kerb, 4, 0.2)]:
        result = run(STEP_HEIGHT, terrain(heights), critical_cell_number=number, **params)
        assert result.max() == pytest.approx(expected)
        assert result[0, 0] == 0


# --- slope, roughness -----------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [0.0, 0.25])
@given(st.tuples(st.floats(-10, 10), st.floats(-10, 10)))
@settings(max_examples=20)
def test_the_slope_of_a_plane_is_its_angle(radius, gradient):
    grid_map = GridMap((0.9, 0.7), 0.1)
    x, y = grid_map.get_positions().T
    z = gradient[0] * x + gradient[1] * y
    grid_map["elevation"] = z.reshape(grid_map.size, order="F")
    slope = run(SLOPE, grid_map, radius=radius)[2:-2, 2:-2]
    np.testing.assert_allclose(slope, np.arctan(np.hypot(*gradient)), atol=2e-5)


def test_gentle_slopes_keep_their_digits():
    grid_map = GridMap((2.0, 2.0), 0.1)
    grid_map["elevation"] = 1e-4 * grid_map.get_positions()[:, 0].reshape(20, 20, order="F")
    for radius in (0.0, 0.2):
        np.testing.assert_allclose(run(SLOPE, grid_map, radius=radius)[5, 5], 1e-4, rtol=1e-3)


def test_the_slope_of_normals_does_not_depend_on_their_length_and_sign():
    normals = {"n_x": [[0.0, 3.0, 0.0, np.nan]], "n_y": [[0, 0, -1, 0]], "n_z": [[2, 3, 0, 1]]}
    grid_map = GridMap((0.1, 0.4), 0.1, layers=normals)
    expected = [[0.0, np.pi / 4, np.pi / 2, np.nan]]
    params = {"input_layers_prefix": "n_", "output_layer": "out"}
    for sign in (1, -1):
        grid_map["n_z"] = sign * np.array(normals["n_z"])
        step = {"name": "slope", "type": SLOPE, "params": params}
        slope = FilterChain.from_config([step])(grid_map)["out"]
        np.testing.assert_allclose(slope, expected, rtol=1e-6)
    with pytest.raises(FilterConfigError, match="no 'radius' beside 'input_layers_prefix'"):
        FilterChain.from_config([step | {"params": params | {"radius": 0.1}}])


@given(grid_maps(), st.sampled_from([0.9, 1.0, 1.5, 2.0, 3.0]))
@settings(max_examples=40)
def test_roughness_is_the_deviation_from_the_best_plane(grid_map, cells):
    grid_map, radius = unwrapped(grid_map), cells * grid_map.resolution
    result = run(ROUGHNESS, grid_map, radius=radius)
    for index in np.ndindex(grid_map.size):
        points = points_in_disc(grid_map, index, radius)
        if not np.isfinite(grid_map["elevation"][index]) or len(points) < 2:
            assert np.isnan(result[index])
            continue
        values = np.linalg.eigvalsh(np.cov(points.T))
        biased = values * (len(points) - 1) / len(points)
        # The plane is defined where the points are not on a line; it is horizontal otherwise.
        flat = len(points) < 3 or biased[1] <= 1e-8
        expected = points[:, 2].std(ddof=1) if flat else np.sqrt(max(values[0], 0.0))
        spread = np.sqrt(values[2])
        assert result[index] == pytest.approx(expected, rel=1e-4, abs=1e-5 * spread + 1e-7)


def test_a_slope_is_not_rough_and_noise_is():
    grid_map = GridMap((4.0, 4.0), 0.1)
    noise = np.random.default_rng(1).normal(scale=0.02, size=(40, 40))
    plane = 0.5 * grid_map.get_positions()[:, 0].reshape(40, 40, order="F")
    grid_map["elevation"] = 1000 + plane
    assert np.nanmax(run(ROUGHNESS, grid_map, radius=0.3)) < 1e-4
    grid_map["elevation"] = plane + noise
    # The distance to an inclined plane is shorter than the difference in height.
    expected = 0.02 * np.cos(np.arctan(0.5))
    assert np.median(run(ROUGHNESS, grid_map, radius=0.5)) == pytest.approx(expected, rel=0.05)


# --- traversability -------------------------------------------------------------------------------


def traversability(layers, critical_values, **params):
    names = [f"layer{number}" for number in range(len(layers))]
    grid_map = GridMap(np.shape(layers[0]), 1.0, layers=dict(zip(names, layers, strict=True)))
    params |= {"input_layers": names, "output_layer": "out", "critical_values": critical_values}
    return run(TRAVERSABILITY, grid_map, **params)


def test_traversability_is_the_weighted_mean_of_what_is_left_to_the_critical_values():
    slope = [[0.0, 0.3, 0.6, 0.9, -0.2, np.nan, np.inf]]
    roughness = [[0.0, 0.0, 0.05, 0.1, 0.0, 0.0, 0.0]]
    result = traversability([slope, roughness], [0.6, 0.1])
    np.testing.assert_allclose(result, [[1, 0.75, 0.25, 0, 1, np.nan, np.nan]], atol=1e-7)
    result = traversability([slope, roughness], [0.6, 0.1], weights=[3, 1])
    np.testing.assert_allclose(result, [[1, 0.625, 0.125, 0, 1, np.nan, np.nan]], atol=1e-7)


WEIGHTS = st.just(0.0) | st.floats(1e-3, 10.0)


@given(
    st.lists(
        st.tuples(st.floats(-1e3, 1e3, width=32), st.floats(1e-3, 1e3), WEIGHTS),
        min_size=1,
        max_size=5,
    )
)
def test_traversability_is_between_0_and_1(terms):
    values, critical, weights = zip(*terms, strict=True)
    weights = weights if any(weights) else None
    result = traversability([[[v]] for v in values], list(critical), weights=weights)[0, 0]
    scores = [min(1.0, max(0.0, 1.0 - v / c)) for v, c in zip(values, critical, strict=True)]
    assert 0 <= result <= 1
    assert result == pytest.approx(np.average(scores, weights=weights), abs=1e-6)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"input_layers": [], "critical_values": []}, "'input_layers': expected at least one"),
        ({"critical_values": [1, 2]}, "'critical_values': expected 1 numbers, one per layer"),
        ({"critical_values": [0]}, "'critical_values': expected numbers > 0"),
        ({"critical_values": [math.inf]}, "'critical_values': expected numbers >= 0"),
        ({"critical_values": [1], "weights": [1, 1]}, "'weights': expected 1 numbers"),
        ({"critical_values": [1], "weights": [-1]}, "'weights': expected numbers >= 0"),
        ({"critical_values": [1], "weights": [0]}, "'weights': expected a number > 0"),
    ],
)
def test_a_traversability_that_makes_no_sense_is_refused(params, message):
    with pytest.raises(FilterConfigError, match=message):
        run(
            TRAVERSABILITY,
            terrain([[1.0]]),
            **{"input_layers": ["elevation"], "output_layer": "out", **params},
        )


@given(grid_maps(("a", "b"), max_side=7))
@settings(max_examples=25)
def test_traversability_leaves_its_input_alone_and_gives_the_same_on_a_moved_map(grid_map):
    params = {"input_layers": ["a", "b"], "output_layer": "out", "critical_values": [10, 500]}
    before = grid_map.copy()
    result = run(TRAVERSABILITY, grid_map, **params)
    assert_maps_equal(grid_map, before)
    moved = moved_in_buffer(grid_map, (0, 0))
    np.testing.assert_array_equal(
        np.roll(result, np.negative(grid_map.start_index), (0, 1)),
        run(TRAVERSABILITY, moved, **params),
    )
    known = np.isfinite(grid_map["a"]) & np.isfinite(grid_map["b"])
    np.testing.assert_array_equal(np.isfinite(result), known)
    assert result.dtype == np.float32


def test_a_chain_of_them_tells_flat_ground_from_a_kerb_and_a_steep_slope():
    grid_map = GridMap((6.0, 2.0), 0.1)
    x, y = (axis.reshape(60, 20, order="F") for axis in grid_map.get_positions().T)
    # From +x to -x: flat, a ramp of 45 degrees, flat, and a kerb of 0.3 m.
    grid_map["elevation"] = np.clip(1.0 - x, 0.0, 1.0) - 0.3 * (x < -1.5) + 0.0 * y
    terms = {"slope": 0.6, "step_height": 0.2, "roughness": 0.1}
    measures = [(SLOPE, "slope"), (STEP_HEIGHT, "step_height"), (ROUGHNESS, "roughness")]
    steps = [
        {
            "name": layer,
            "type": type_name,
            "params": {"input_layer": "elevation", "output_layer": layer, "radius": 0.2},
        }
        for type_name, layer in measures
    ]
    params = {"input_layers": [*terms], "critical_values": [*terms.values()], "output_layer": "out"}
    steps.append({"name": "all", "type": TRAVERSABILITY, "params": params})
    result = FilterChain.from_config(steps)(grid_map)["out"]
    on_flat, on_ramp, at_kerb = (
        result[grid_map.get_index((place, 0.0))] for place in (2.0, 0.5, -1.5)
    )
    assert on_flat == pytest.approx(1.0)
    assert on_ramp == pytest.approx(1 / 3, abs=1e-5)  # Steep, steps in every disc, but even.
    assert at_kerb < 0.5


# --- smoothing ------------------------------------------------------------------------------------


@given(grid_maps(), st.floats(0.3, 3.0), st.sampled_from([None, 0.0, 1.0, 2.5]), st.booleans())
@settings(max_examples=40)
def test_gaussian_blur_is_the_weighted_mean_of_the_finite_cells(
    grid_map, sigma, radius, compute_empty_cells
):
    grid_map = unwrapped(grid_map)
    sigma *= grid_map.resolution
    radius = None if radius is None else radius * grid_map.resolution
    reach = 3 * sigma if radius is None else radius
    params = {"sigma": sigma, "radius": radius, "compute_empty_cells": compute_empty_cells}
    result = run(BLUR, grid_map, **params)
    rows, columns = np.indices(grid_map.size) * grid_map.resolution
    heights = grid_map["elevation"].astype(np.float64)
    finite = np.isfinite(heights)

    def mean(index):
        across, along = rows - rows[index], columns - columns[index]
        near = np.maximum(np.abs(across), np.abs(along)) <= reach + 1e-9
        used = near & finite
        if not used.any() or not (compute_empty_cells or finite[index]):
            return np.nan
        weights = np.exp(-(across**2 + along**2) / (2 * sigma**2))
        return np.average(heights[used], weights=weights[used])

    assert_cells_are(result, mean, rtol=1e-5, atol=1e-4)


def test_a_constant_stays_constant_at_borders_and_holes():
    heights = np.full((20, 15), 1234.5)
    heights[5:9, 3:11] = np.nan
    for type_name, params in [
        (BLUR, {"sigma": 0.3}),
        (BILATERAL, {"sigma_space": 0.2, "sigma_range": 0.1}),
    ]:
        np.testing.assert_allclose(run(type_name, terrain(heights), **params), heights, rtol=1e-7)


@given(grid_maps(), st.floats(0.3, 2.0), st.floats(0.1, 1e3), st.sampled_from([None, 1.0, 2.5]))
@settings(max_examples=40)
def test_bilateral_weighs_by_distance_and_by_difference(grid_map, sigma, sigma_range, radius):
    grid_map = unwrapped(grid_map)
    sigma *= grid_map.resolution
    radius = None if radius is None else radius * grid_map.resolution
    reach = 3 * sigma if radius is None else radius
    result = run(BILATERAL, grid_map, sigma_space=sigma, sigma_range=sigma_range, radius=radius)
    heights = grid_map["elevation"].astype(np.float64)

    def mean(index):
        if not np.isfinite(heights[index]):
            return np.nan
        points = points_in_disc(grid_map, index, reach)
        distances = np.linalg.norm(points[:, :2] - grid_map.get_position(index), axis=1)
        differences = points[:, 2] - heights[index]
        exponents = (distances / sigma) ** 2 + (differences / sigma_range) ** 2
        return np.average(points[:, 2], weights=np.exp(-0.5 * exponents))

    assert_cells_are(result, mean, rtol=1e-4, atol=1e-3)


def test_bilateral_keeps_an_edge_that_a_gaussian_blurs():
    noise = np.random.default_rng(2).normal(scale=0.01, size=(30, 30))
    heights = np.where(np.arange(30)[:, None] < 15, 0.0, 1.0) + noise
    sharp = run(BILATERAL, terrain(heights), sigma_space=0.2, sigma_range=0.1)
    blurred = run(BLUR, terrain(heights), sigma=0.2)
    assert (sharp[15] - sharp[14]).min() > 0.97
    assert (blurred[15] - blurred[14]).max() < 0.3
    assert sharp[:14].std() < 0.4 * noise.std()


@pytest.mark.parametrize(
    ("type_name", "params"),
    [(BLUR, {"sigma": 0.3}), (BILATERAL, {"sigma_space": 0.3, "sigma_range": 1.0})],
)
def test_a_huge_value_spoils_only_its_surroundings(type_name, params):
    heights = np.ones((40, 40), dtype=np.float32)
    heights[5, 5], heights[5, 6] = 3e38, -3e38
    result = run(type_name, terrain(heights), **params)
    np.testing.assert_array_equal(result[20:, :], 1.0)
    assert np.isfinite(result).all()


# --- limits of inpainting -------------------------------------------------------------------------


def holed() -> np.ndarray:
    """Holes of 1, 4 and 9 cells, one at the border, and one that joins it across a corner."""
    heights = np.random.default_rng(4).normal(size=(20, 24))
    heights[3, 3] = heights[6:8, 6:8] = np.nan
    heights[12:15, 12:15] = np.inf
    heights[0, 10:12] = np.nan
    heights[18, 20] = heights[19, 21] = np.nan
    return heights


@pytest.mark.parametrize(
    ("limits", "left"),
    [
        ({}, 0),
        ({"enclosed_holes_only": True}, 4),
        ({"max_hole_area": 0.04}, 9),
        ({"max_hole_area": 0.0399}, 13),
        ({"max_hole_area": 0.0}, 18),
        ({"enclosed_holes_only": True, "max_hole_area": 0.01}, 17),
        ({"enclosed_holes_only": True, "max_hole_area": 1e9}, 4),
    ],
)
def test_inpainting_fills_the_holes_that_it_may_and_leaves_the_others(limits, left):
    heights = holed()
    filled, everything = (
        run(INPAINT, terrain(heights), radius=0.2, **params) for params in (limits, {})
    )
    kept = ~np.isfinite(filled)
    assert np.count_nonzero(kept) == left
    np.testing.assert_array_equal(filled[kept], heights[kept])
    np.testing.assert_array_equal(filled[~kept], everything[~kept])


def cells_of_hole(missing, start):
    """The cells connected with one, found by walking."""
    found, new = set(), [start]
    while new:
        row, column = new.pop()
        on_map = 0 <= row < missing.shape[0] and 0 <= column < missing.shape[1]
        if on_map and missing[row, column] and (row, column) not in found:
            found.add((row, column))
            new += [(row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return found


@given(grid_maps(max_side=9), st.integers(0, 12), st.booleans())
@settings(max_examples=50)
def test_inpainting_within_limits_fills_what_a_walk_through_every_hole_says(
    grid_map, cells, enclosed
):
    grid_map = unwrapped(grid_map)
    heights, area = grid_map["elevation"], cells * grid_map.resolution**2
    missing = ~np.isfinite(heights)
    if missing.all():
        return
    limits = {"enclosed_holes_only": enclosed, "max_hole_area": area}
    filled = run(INPAINT, grid_map, radius=0.3, **limits)
    for index in np.ndindex(missing.shape):
        hole = cells_of_hole(missing, index)
        last = np.subtract(missing.shape, 1)
        at_border = any(0 in cell or any(cell == last) for cell in hole)
        expected = not missing[index] or (len(hole) <= cells and not (enclosed and at_border))
        assert np.isfinite(filled[index]) == expected
