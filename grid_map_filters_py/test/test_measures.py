# SPDX-License-Identifier: BSD-3-Clause
"""The filters that measure terrain, against loops over cells and known surfaces."""

from contextlib import nullcontext
from functools import partial

import filter_oracles as oracles
import numpy as np
import pytest
from filter_cases import (
    CELLS,
    CELLS_OF_PLANES,
    TO_OUT,
    assert_cells_are,
    filtered,
    points_in_disc,
    run,
    terrain,
)
from hypothesis import given, settings, strategies as st

from grid_map_core_py import circle_cells
from grid_map_core_py.testing import grid_maps
from grid_map_filters_py import FilterConfigError, FilterWarning

PLAIN_MAPS = grid_maps(allow_moved=False)

# --- parameters in another unit -------------------------------------------------------------------

NORMALS = {"output_layers_prefix": "n_", "normal_vector_positive_axis": "z"}
SCORE = {"input_layers": ["slope"], "output_layer": "out", "critical_values": [30.0]}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("type_name", "params", "slopes", "text"),
    [
        ("Roughness", TO_OUT | {"radius": 0.09}, [0, 1, 2], "at least one cell, 0.1 m, got 0.09 m"),
        ("Slope", TO_OUT | {"radius": 0.02}, [0, 1, 2], "radius: expected at least one cell"),
        ("NormalVectors", NORMALS | {"radius": 0.02}, [0, 1, 2], "radius: expected at least one"),
        ("Slope", TO_OUT | {"radius": 0.0}, [0, 1, 2], None),
        (
            "Traversability",
            SCORE,
            [0.2, np.nan, 1.5],
            r"1.571 \[rad\] for slope, got 30. 30 deg",
        ),
        ("Traversability", SCORE | {"critical_values": [0.5]}, [0.2, np.nan, 1.5], None),
        ("Traversability", SCORE, [0.2, np.nan, 40.0], None),
        ("Traversability", SCORE, [0, 0, 0], None),
        ("Traversability", SCORE, [np.nan] * 3, None),
    ],
)
def test_parameters_in_another_unit_warn(type_name, params, slopes, text):
    params = params if params.keys() & {"input_layers"} else params | {"input_layer": "slope"}
    with nullcontext() if text is None else pytest.warns(FilterWarning, match=text):
        run(type_name, terrain((1, 3), slope=[slopes]), **params)


# --- Curvature ------------------------------------------------------------------------------------


@given(PLAIN_MAPS)
@settings(max_examples=60)
def test_curvature_is_minus_the_second_differences(grid_map):
    expected = oracles.curvature(grid_map["elevation"], grid_map.resolution)
    slack = 1e-6 * 1e3 / grid_map.resolution**2
    np.testing.assert_allclose(filtered("Curvature", grid_map), expected, atol=slack)


# --- Roughness ------------------------------------------------------------------------------------

roughness = partial(filtered, "Roughness")


@given(PLAIN_MAPS, CELLS_OF_PLANES)
@settings(max_examples=40)
def test_roughness_is_the_deviation_from_the_plane(grid_map, cells):
    radius = cells * grid_map.resolution
    result = roughness(grid_map, radius=radius)
    for index in np.ndindex(grid_map.size):
        points = points_in_disc(grid_map, index, radius)
        if not np.isfinite(grid_map["elevation"][index]) or len(points) < 2:
            assert np.isnan(result[index])
            continue
        values = np.linalg.eigvalsh(np.cov(points.T))
        biased = values * (len(points) - 1) / len(points)
        # The plane of points on a line is horizontal.
        flat = len(points) < 3 or biased[1] <= 1e-8
        expected = points[:, 2].std(ddof=1) if flat else np.sqrt(max(values[0], 0.0))
        spread = np.sqrt(values[2])
        assert result[index] == pytest.approx(expected, rel=1e-4, abs=1e-5 * spread + 1e-7)


# --- Slope ----------------------------------------------------------------------------------------

slope = partial(filtered, "Slope")


@pytest.mark.parametrize("radius", [0.0, 0.25])
@given(st.tuples(st.floats(-10, 10), st.floats(-10, 10)))
@settings(max_examples=20)
def test_the_slope_of_a_plane_is_its_angle(radius, gradient):
    grid_map = terrain((9, 7))
    x, y = grid_map.axes()
    grid_map["elevation"] = gradient[0] * x[:, None] + gradient[1] * y
    angles = slope(grid_map, radius=radius)[2:-2, 2:-2]
    np.testing.assert_allclose(angles, np.arctan(np.hypot(*gradient)), atol=2e-5)


@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_gentle_slopes_keep_precision(radius):
    grid_map = terrain((20, 20))
    grid_map["elevation"] = np.tile(1e-4 * grid_map.axes()[0][:, None], 20)
    np.testing.assert_allclose(slope(grid_map, radius=radius)[5, 5], 1e-4, rtol=1e-3)


def test_length_and_sign_of_normals_do_not_matter():
    normals = {"n_x": [[0.0, 3.0, 0.0, np.nan]], "n_y": [[0, 0, -1, 0]], "n_z": [[2, 3, 0, 1]]}
    grid_map = terrain((1, 4), **normals)
    expected = [[0.0, np.pi / 4, np.pi / 2, np.nan]]
    params = {"input_layers_prefix": "n_", "output_layer": "out"}
    for sign in (1, -1):
        grid_map["n_z"] = sign * np.array(normals["n_z"])
        np.testing.assert_allclose(run("Slope", grid_map, **params)["out"], expected, rtol=1e-6)
    with pytest.raises(FilterConfigError, match="no 'radius' beside 'input_layers_prefix'"):
        run("Slope", grid_map, radius=0.1, **params)


# --- StepHeight -----------------------------------------------------------------------------------

step_height = partial(filtered, "StepHeight")


@given(PLAIN_MAPS, CELLS)
@settings(max_examples=40)
def test_step_height_is_the_largest_difference_in_the_disc(grid_map, cells):
    radius = cells * grid_map.resolution

    def step(index):
        heights = points_in_disc(grid_map, index, radius)[:, 2]
        return np.ptp(heights) if np.isfinite(grid_map["elevation"][index]) else np.nan

    assert_cells_are(step_height(grid_map, radius=radius), step, rtol=1e-6)


@given(PLAIN_MAPS, CELLS, CELLS, st.integers(1, 8), st.floats(0, 1000, width=16))
@settings(max_examples=40)
def test_second_window_weighs_steps_by_number_of_cells(grid_map, first, second, number, critical):
    first, second = first * grid_map.resolution, second * grid_map.resolution
    params = {"radius": first, "second_window_radius": second}
    result = step_height(grid_map, **params, critical_value=critical, critical_cell_number=number)
    steps = step_height(grid_map, radius=first)

    def weighed(index):
        around = steps[circle_cells(grid_map, grid_map.get_position(index), second)]
        around = around[np.isfinite(around)].astype(np.float64)
        if not around.size:
            return np.nan
        return min(1.0, np.sum(around > critical) / number) * around.max()

    assert_cells_are(result, weighed, rtol=1e-6)


# --- Traversability -------------------------------------------------------------------------------


def traversability(layers, critical_values, **params):
    names = [f"layer{number}" for number in range(len(layers))]
    grid_map = terrain(np.shape(layers[0]), **dict(zip(names, layers, strict=True)))
    params |= {"input_layers": names, "output_layer": "out", "critical_values": critical_values}
    return run("Traversability", grid_map, **params)["out"]


@pytest.mark.parametrize(
    ("weights", "expected"),
    [
        ({}, [1, 0.75, 0.25, 0, 1, np.nan, np.nan]),
        ({"weights": [3, 1]}, [1, 0.625, 0.125, 0, 1, np.nan, np.nan]),
    ],
)
def test_traversability_is_the_weighted_mean_of_scores(weights, expected):
    slope = [[0.0, 0.3, 0.6, 0.9, -0.2, np.nan, np.inf]]
    roughness = [[0.0, 0.0, 0.05, 0.1, 0.0, 0.0, 0.0]]
    result = traversability([slope, roughness], [0.6, 0.1], **weights)
    np.testing.assert_allclose(result, [expected], atol=1e-7)


WEIGHTS = st.just(0.0) | st.floats(1e-3, 10.0)
TERMS = st.tuples(st.floats(-1e3, 1e3, width=32), st.floats(1e-3, 1e3), WEIGHTS)


@given(st.lists(TERMS, min_size=1, max_size=5))
def test_traversability_is_between_0_and_1(terms):
    values, critical, weights = zip(*terms, strict=True)
    weights = weights if any(weights) else None
    params = {"weights": weights} if weights else {}
    result = traversability([[[v]] for v in values], list(critical), **params)[0, 0]
    scores = [min(1.0, max(0.0, 1.0 - v / c)) for v, c in zip(values, critical, strict=True)]
    assert 0 <= result <= 1
    assert result == pytest.approx(np.average(scores, weights=weights), abs=1e-6)
