# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Filters against naive loops, and what holds for all of them."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grid_map_core_py import GridMap, circle_cells, color_value_to_vector
from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_filters_py import FilterChain, FilterError, FilterWarning

LAYERS = ("elevation", "other", "n_x", "n_y", "n_z")


def run(type_name, grid_map, **params):
    step = {"name": "under_test", "type": type_name, "params": params}
    return FilterChain.from_config([step])(grid_map)


def mean_in_radius(grid_map, radius, layer="elevation"):
    return run(
        "gridMapFilters/MeanInRadiusFilter",
        grid_map,
        input_layer=layer,
        output_layer="out",
        radius=radius,
    )["out"]


def normals(grid_map, **params):
    params = {
        "input_layer": "elevation",
        "output_layers_prefix": "normal_",
        "normal_vector_positive_axis": "z",
        **params,
    }
    result = run("gridMapFilters/NormalVectorsFilter", grid_map, **params)
    return np.stack([result["normal_" + axis] for axis in "xyz"], axis=-1)


def inpaint(grid_map, radius=0.3):
    return run(
        "gridMapCv/InpaintFilter",
        grid_map,
        input_layer="elevation",
        output_layer="filled",
        radius=radius,
    )["filled"]


def points_in_disc(grid_map, index, radius):
    """The finite 3-D points of a disc, looked up cell by cell."""
    cells = circle_cells(grid_map, grid_map.get_position(index), radius)
    points = [grid_map.get_position3("elevation", cell) for cell in cells]
    return np.array([point for point in points if np.isfinite(point).all()]).reshape(-1, 3)


def terrain(size=(9, 7), resolution=0.1, start_index=(0, 0), **layers) -> GridMap:
    grid_map = GridMap(np.multiply(size, resolution), resolution, layers=layers)
    grid_map.start_index = start_index
    return grid_map


EVERY_FILTER = [
    ("gridMapFilters/BufferNormalizerFilter", {}),
    ("gridMapFilters/DeletionFilter", {"layers": ["other"]}),
    ("gridMapFilters/DuplicationFilter", {"input_layer": "elevation", "output_layer": "out"}),
    (
        "gridMapFilters/MathExpressionFilter",
        {"expression": "elevation + other", "output_layer": "out"},
    ),
    (
        "gridMapFilters/MeanInRadiusFilter",
        {"input_layer": "elevation", "output_layer": "elevation", "radius": 0.3},
    ),
    (
        "gridMapFilters/NormalColorMapFilter",
        {"input_layers_prefix": "n_", "output_layer": "color"},
    ),
    (
        "gridMapFilters/NormalVectorsFilter",
        {
            "input_layer": "elevation",
            "output_layers_prefix": "n_",
            "normal_vector_positive_axis": "z",
            "radius": 0.3,
        },
    ),
    (
        "gridMapFilters/NormalVectorsFilter",
        {
            "input_layer": "elevation",
            "output_layers_prefix": "n_",
            "normal_vector_positive_axis": "x",
            "algorithm": "raster",
        },
    ),
    (
        "gridMapFilters/SlidingWindowMathExpressionFilter",
        {
            "input_layer": "elevation",
            "output_layer": "elevation",
            "expression": "meanOfFinites(elevation)",
            "edge_handling": "crop",
        },
    ),
    (
        "gridMapFilters/ThresholdFilter",
        {"layer": "elevation", "upper_threshold": 1.0, "set_to": 1.0},
    ),
    (
        "gridMapCv/InpaintFilter",
        {"input_layer": "elevation", "output_layer": "elevation", "radius": 0.3},
    ),
]


@pytest.mark.parametrize(("type_name", "params"), EVERY_FILTER, ids=lambda value: str(value)[:60])
@given(grid_maps(LAYERS, max_side=7))
@settings(max_examples=25)
def test_every_filter_leaves_its_input_alone_and_gives_the_same_on_a_moved_map(
    type_name, params, grid_map
):
    before = grid_map.copy()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FilterWarning)
        result = run(type_name, grid_map, **params)
        elsewhere = tuple(np.subtract(grid_map.size, 1) // 2)
        again = run(type_name, moved_in_buffer(grid_map, elsewhere), **params)
    assert_maps_equal(grid_map, before)
    assert grid_map.start_index == before.start_index
    assert_maps_equal(again, result)
    for layer in result:
        assert result[layer].dtype == np.float32
        assert result[layer].flags.f_contiguous
        assert not any(np.shares_memory(result[layer], grid_map[name]) for name in grid_map)


@pytest.mark.parametrize(("type_name", "params"), EVERY_FILTER[2:], ids=lambda v: str(v)[:60])
def test_a_filter_on_a_map_without_its_layer_names_the_layers_there_are(type_name, params):
    with pytest.raises(FilterError, match="available: only"):
        run(type_name, terrain(only=0.0), **params)


@given(grid_maps(allow_infinity=True), st.sampled_from([0.0, 0.9, 1.0, 1.5, 2.0, 2.3, 5.0, 8.0]))
@settings(max_examples=60)
def test_mean_in_radius_is_the_mean_of_the_finite_values_in_the_disc(grid_map, cells):
    radius = cells * grid_map.resolution
    grid_map.convert_to_default_start_index()
    result = mean_in_radius(grid_map, radius)
    for index in np.ndindex(grid_map.size):
        z = points_in_disc(grid_map, index, radius)[:, 2]
        expected = z.mean() if z.size else np.nan
        np.testing.assert_allclose(result[index], expected, rtol=1e-5, atol=1e-3)


def test_a_disc_far_larger_than_the_map_is_the_map():
    grid_map = terrain((10, 7), elevation=np.arange(70.0).reshape(10, 7))
    np.testing.assert_allclose(mean_in_radius(grid_map, 1e6), 34.5)
    assert np.isfinite(normals(grid_map, radius=1e6)).all()


def test_mean_in_radius_keeps_small_differences_on_high_ground():
    heights = np.random.default_rng(1).normal(size=(30, 20)).astype(np.float32) * 0.01
    low = mean_in_radius(terrain((30, 20), elevation=heights), 0.35)
    high = mean_in_radius(terrain((30, 20), elevation=heights + np.float32(2000)), 0.35)
    np.testing.assert_allclose(high - 2000, low, atol=3e-4)
    # The normals of a gentle slope, where the variance of the heights is 1e-11 of their square.
    grid_map = terrain((30, 20))
    x, _ = grid_map.geometry.axes()
    grid_map["elevation"] = np.float32(4096) + np.round(x / 8, 3)[:, None] * np.ones(20)
    plain = grid_map.with_layers({"elevation": grid_map["elevation"] - np.float32(4096)})
    np.testing.assert_allclose(
        normals(grid_map, radius=0.35), normals(plain, radius=0.35), atol=1e-6
    )


def test_a_huge_value_spoils_only_the_discs_that_hold_it():
    heights = np.ones((40, 40), dtype=np.float32)
    heights[5, 5] = 1e30
    result = mean_in_radius(terrain((40, 40), elevation=heights), 0.6)
    np.testing.assert_array_equal(result[20:, :], 1.0)
    assert result[5, 5] > 1e27


@given(grid_maps(allow_infinity=True), st.sampled_from([0.9, 1.0, 1.5, 2.0, 3.0]))
@settings(max_examples=40)
def test_area_normals_are_those_of_the_best_plane(grid_map, cells):
    radius = cells * grid_map.resolution
    grid_map.convert_to_default_start_index()
    result = normals(grid_map, radius=radius)
    for index in np.ndindex(grid_map.size):
        normal, points = result[index], points_in_disc(grid_map, index, radius)
        if not np.isfinite(grid_map["elevation"][index]):
            assert np.isnan(normal).all()
            continue
        np.testing.assert_allclose(np.linalg.norm(normal), 1.0, rtol=1e-5)
        values, vectors = (
            np.linalg.eigh(np.cov(points.T, bias=True))
            if len(points) >= 3
            else (
                np.zeros(3),
                None,
            )
        )
        if values[1] <= 1e-8:
            assert normal.tolist() == [0, 0, 1]
            continue
        assert normal[2] >= 0
        # The direction is defined as far as the smallest eigenvalue stands apart from the next.
        variance = normal @ np.cov(points.T, bias=True) @ normal
        assert variance <= values[0] + 1e-5 * values[2]
        if values[1] - values[0] > 1e-2 * values[2]:
            assert abs(normal @ vectors[:, 0]) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("params", [{"radius": 0.25}, {"algorithm": "raster"}, {}])
@given(slope=st.tuples(st.floats(-3, 3), st.floats(-3, 3)), height=st.floats(-2000, 2000))
@settings(max_examples=20)
def test_normals_of_a_plane_are_those_of_the_plane(params, slope, height):
    grid_map = terrain((9, 7))
    x, y = grid_map.get_positions().T
    z = (slope[0] * x + slope[1] * y).reshape(grid_map.size, order="F")
    grid_map["elevation"] = z + height
    expected = np.array([-slope[0], -slope[1], 1.0]) / np.linalg.norm([*slope, 1.0])
    result = normals(grid_map, **params)[2:-2, 2:-2]
    # Heights are float32: at 2000 m they are exact to 0.1 mm, over 0.2 m.
    np.testing.assert_allclose(result, np.broadcast_to(expected, result.shape), atol=2e-3)


def test_a_symmetric_spike_has_a_unit_normal_in_the_least_spread_plane():
    heights = np.zeros((5, 5), dtype=np.float32)
    heights[2, 2] = 50.0
    normal = normals(terrain((5, 5), elevation=heights), radius=0.1)[2, 2]
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    assert normal[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("spread", [0.5e-8, 2e-8])
def test_points_closer_to_a_line_than_1e_8_have_no_plane(spread):
    """Two rows of points: the variance across them is a quarter of the resolution squared."""
    resolution = 2 * np.sqrt(spread)
    heights = np.tile(resolution * np.arange(40.0)[None, :], (2, 1))
    grid_map = terrain((2, 40), resolution, elevation=heights)
    middle = normals(grid_map, radius=resolution * 20)[0, 20]
    upright = middle.tolist() == [0, 0, 1]
    assert upright == (spread < 1e-8)


def test_a_wall_has_a_horizontal_normal():
    heights = np.where(np.arange(9)[:, None] < 4, 1e4, 0.0) * np.ones(9)
    normal = normals(terrain((9, 9), elevation=heights), radius=0.15)[4, 4]
    np.testing.assert_allclose(np.abs(normal), [1, 0, 0], atol=1e-3)


def test_normals_point_to_the_positive_side_of_the_axis_that_was_asked_for():
    grid_map = terrain((9, 9))
    x, y = grid_map.get_positions().T
    grid_map["elevation"] = np.sin(9 * x + 4 * y).reshape(grid_map.size, order="F")
    for number, axis in enumerate("xyz"):
        for params in ({"radius": 0.15}, {"algorithm": "raster"}):
            result = normals(grid_map, normal_vector_positive_axis=axis, **params)
            assert np.nanmin(result[..., number]) >= 0


def test_raster_normals_use_one_side_next_to_a_hole_and_leave_the_border_empty():
    heights = np.tile(np.arange(6, dtype=np.float32)[:, None] * 0.1, (1, 5))
    heights[2, 2] = np.nan
    result = normals(terrain((6, 5), elevation=heights), algorithm="raster")
    assert np.isnan(result[0]).all()
    assert np.isnan(result[:, -1]).all()
    expected = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    for index in [(1, 2), (3, 2), (1, 1), (4, 3)]:
        np.testing.assert_allclose(result[index], expected, atol=1e-6)


def test_normal_colors_map_the_axes_to_red_green_and_blue():
    grid_map = terrain((3, 1), n_x=[[1], [0], [np.nan]], n_y=[[-1], [0], [0]], n_z=[[0], [1], [0]])
    params = {"input_layers_prefix": "n_", "output_layer": "color"}
    color = run("gridMapFilters/NormalColorMapFilter", grid_map, **params)["color"]
    rgb = color_value_to_vector(color)[:, 0]
    np.testing.assert_allclose(rgb[0], [1, 0, 127 / 255], atol=1e-6)
    np.testing.assert_allclose(rgb[1], [127 / 255, 127 / 255, 1], atol=1e-6)
    assert np.isnan(rgb[2]).all()


class TestInpaint:
    @given(grid_maps())
    @settings(max_examples=60)
    def test_fills_every_hole_and_leaves_finite_cells_to_the_bit(self, grid_map):
        grid_map.convert_to_default_start_index()
        before = grid_map["elevation"]
        finite = np.isfinite(before)
        if not finite.any():
            with pytest.warns(FilterWarning, match="no finite cell"):
                np.testing.assert_array_equal(inpaint(grid_map), before)
            return
        filled = inpaint(grid_map)
        np.testing.assert_array_equal(
            filled[finite].view(np.uint32), before[finite].view(np.uint32)
        )
        assert np.isfinite(filled).all()
        slack = 1e-5 * max(1.0, np.abs(before[finite]).max())
        assert filled.min() >= before[finite].min() - slack
        assert filled.max() <= before[finite].max() + slack

    def test_continues_a_ramp_across_a_hole_without_steps_of_8_bits(self):
        ramp = np.tile(np.linspace(100.0, 110.0, 40, dtype=np.float32)[:, None], (1, 40))
        holed = ramp.copy()
        holed[15:25, 15:25] = np.nan
        filled = inpaint(terrain((40, 40), elevation=holed))
        assert np.abs(filled - ramp).max() < 1.0
        assert len(np.unique(filled[15:25, 15:25])) > 40

    def test_cells_beside_the_hole_decide_and_not_the_order_of_the_buffer(self):
        heights = np.full((12, 10), 5.0, dtype=np.float32)
        heights[0:3, 0:3] = np.nan
        for start in [(0, 0), (2, 1), (11, 9)]:
            grid_map = moved_in_buffer(terrain((12, 10), elevation=heights), start)
            np.testing.assert_allclose(inpaint(grid_map), 5.0, rtol=1e-6)

    def test_extreme_ranges_stay_finite(self):
        heights = np.array([[-3e38, np.nan], [np.nan, 3e38], [1.0, np.inf]], dtype=np.float32)
        assert np.isfinite(inpaint(terrain((3, 2), elevation=heights))).all()


class TestThreshold:
    def run(self, grid_map, **params):
        return run("gridMapFilters/ThresholdFilter", grid_map, **params)

    def test_sets_what_is_below_or_above_and_never_what_is_not_finite(self):
        values = np.array([[1, 2, 3, np.nan, np.inf, -np.inf]], dtype=np.float32)
        grid_map = terrain((1, 6), a=values)
        lower = self.run(grid_map, layer="a", lower_threshold=2, set_to=0)["a"]
        np.testing.assert_array_equal(lower, [[0, 2, 3, np.nan, np.inf, -np.inf]])
        upper = self.run(grid_map, layer="a", upper_threshold=2.0, set_to=np.nan)["a"]
        np.testing.assert_array_equal(upper, [[1, 2, np.nan, np.nan, np.inf, -np.inf]])

    def test_writes_to_another_layer_than_it_compares(self):
        grid_map = terrain((1, 3), a=[[1, 2, 3]], b=[[7, 8, 9]])
        params = {"condition_layer": "a", "lower_threshold": 2.5, "set_to": np.inf}
        result = self.run(grid_map, output_layer="b", **params)
        np.testing.assert_array_equal(result["b"], [[np.inf, np.inf, 9]])
        np.testing.assert_array_equal(result["a"], grid_map["a"])
        with pytest.raises(FilterError, match="no layer 'c'; available: a, b"):
            self.run(grid_map, output_layer="c", **params)

    def test_compares_in_double_precision(self):
        grid_map = terrain((1, 2), a=[[0.1, 0.2]])
        # The float32 nearest to 0.1 lies above it, and that nearest to 0.7 below.
        above = self.run(grid_map, layer="a", upper_threshold=0.1, set_to=5)["a"]
        assert above[0, 0] == 5
        huge = self.run(grid_map, layer="a", lower_threshold=1e300, set_to=-1e300)["a"]
        assert (huge == -np.inf).all()


def test_deleting_a_layer_that_is_not_there_is_a_warning():
    grid_map = terrain(a=1.0, b=2.0)
    grid_map.basic_layers = ["a"]
    with pytest.warns(FilterWarning, match=r"filter 1 'under_test'.*no layer nope to delete"):
        result = run("gridMapFilters/DeletionFilter", grid_map, layers=["a", "nope"])
    assert result.layers == ("b",)
    assert result.basic_layers == ()


def test_a_scalar_expression_fills_the_layer_and_another_shape_is_an_error():
    grid_map = terrain((4, 3), a=2.0)
    type_name = "gridMapFilters/MathExpressionFilter"
    result = run(type_name, grid_map, expression="sum(a)", output_layer="out")
    np.testing.assert_array_equal(result["out"], np.full((4, 3), 24.0))
    with pytest.raises(
        FilterError, match=r"shape \(3, 4\); expected a scalar or the map's \(4, 3\)"
    ):
        run(type_name, grid_map, expression="transpose(a)", output_layer="out")


@pytest.mark.parametrize(
    ("length", "cells"), [(0.05, 1), (0.3, 3), (0.16, 3), (0.24, 3), (0.25, 3), (0.36, 5)]
)
def test_a_window_length_is_rounded_to_an_odd_number_of_cells(length, cells):
    params = {
        "input_layer": "a",
        "output_layer": "n",
        "expression": "numberOfFinites(a)",
        "edge_handling": "crop",
    }
    type_name = "gridMapFilters/SlidingWindowMathExpressionFilter"
    result = run(type_name, terrain((11, 9), a=1.0), window_length=length, **params)
    assert result["n"][5, 4] == cells**2


def test_empty_cells_stay_empty_when_they_are_not_to_be_computed():
    grid_map = terrain((3, 3), a=[[1, 1, 1], [1, np.nan, 1], [1, 1, 1]])
    params = {
        "input_layer": "a",
        "output_layer": "n",
        "expression": "sumOfFinites(a)",
        "edge_handling": "crop",
    }
    type_name = "gridMapFilters/SlidingWindowMathExpressionFilter"
    assert run(type_name, grid_map, compute_empty_cells=True, **params)["n"][1, 1] == 8
    assert np.isnan(run(type_name, grid_map, compute_empty_cells=False, **params)["n"][1, 1])
