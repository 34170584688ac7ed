# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Filters against naive loops, and what holds for all of them."""

import warnings

import filter_oracles as oracles
import numpy as np
import pytest
import test_more_filters
from hypothesis import given, settings
from hypothesis import strategies as st

from grid_map_core_py import GridMap, circle_cells, color_value_to_vector, color_vector_to_value
from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_filters_py import FILTERS, FilterChain, FilterConfigError, FilterError, FilterWarning
from grid_map_filters_py.medians import put_window_medians

MORE_FILTERS = test_more_filters.EVERY_FILTER
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
    ("gridMapFilters/SetBasicLayersFilter", {"layers": ["other"]}),
    (
        "gridMapFilters/ColorFillFilter",
        {"red": 0.1, "green": 0.5, "blue": 0.9, "output_layer": "color"},
    ),
    (
        "gridMapFilters/ColorFillFilter",
        {"red": 0.1, "green": 0.5, "blue": 0.9, "mask_layer": "other", "output_layer": "color"},
    ),
    *(
        (
            "gridMapFilters/ColorBlendingFilter",
            {
                "background_layer": "elevation",
                "foreground_layer": "other",
                "blend_mode": mode,
                "opacity": 0.4,
                "output_layer": "color",
            },
        )
        for mode in ("normal", "hard_light", "soft_light")
    ),
    (
        "gridMapFilters/ColorMapFilter",
        {
            "input_layer": "elevation",
            "output_layer": "color",
            "min": {"value": -1.0, "color": [0, 0, 1]},
            "max": {"value": 1.0, "color": [1, 0, 0]},
        },
    ),
    ("gridMapFilters/CurvatureFilter", {"input_layer": "elevation", "output_layer": "elevation"}),
    (
        "gridMapFilters/LightIntensityFilter",
        {"input_layers_prefix": "n_", "output_layer": "color", "light_direction": [0.3, 0.1, -1]},
    ),
    (
        "gridMapFilters/MedianFillFilter",
        {
            "input_layer": "elevation",
            "output_layer": "elevation",
            "fill_hole_radius": 0.2,
            "filter_existing_values": True,
            "existing_value_radius": 0.1,
            "fill_mask_layer": "mask",
            "debug": True,
            "debug_infill_mask_layer": "opened",
        },
    ),
    (
        "gridMapFilters/MedianFillFilter",
        {
            "input_layer": "elevation",
            "output_layer": "filled",
            "fill_hole_radius": 0.3,
            "fill_mask_layer": "other",
        },
    ),
    (
        "gridMapFilters/MinInRadiusFilter",
        {"input_layer": "elevation", "output_layer": "elevation", "radius": 0.3},
    ),
    (
        "gridMapFilters/TraversabilityFilter",
        {
            "input_layers": ["elevation", "other"],
            "critical_values": [1.0, 2.0],
            "output_layer": "out",
        },
    ),
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


def with_those_of_the_other_page():
    yield from EVERY_FILTER
    for type_name, params in MORE_FILTERS:
        yield type_name, {"input_layer": "elevation", "output_layer": "out", **params}


def test_every_registered_filter_is_among_those_that_are_tested_together():
    assert {type_name for type_name, _ in with_those_of_the_other_page()} == {*FILTERS.types}


EXTREMES = {
    "nothing": [np.nan],
    "infinite": [np.inf, -np.inf],
    "mixed": [1.0, np.nan, -np.inf, 0.25, np.inf, -3.0, np.nan],
    "huge": [3e38, -3e38, 1e-45],
}


@pytest.mark.parametrize("size", [(1, 1), (1, 6), (7, 1), (5, 4)], ids=str)
@pytest.mark.parametrize("values", EXTREMES.values(), ids=EXTREMES)
def test_every_filter_works_on_maps_of_one_cell_or_row_without_data_or_with_infinities(
    size, values
):
    for type_name, params in with_those_of_the_other_page():
        grid_map = terrain(size, **{name: np.resize(values, size) for name in LAYERS})
        before, elsewhere = grid_map.copy(), tuple(np.subtract(size, 1) // 2)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FilterWarning)
            result = run(type_name, grid_map, **params)
            again = run(type_name, moved_in_buffer(grid_map, elsewhere), **params)
        assert_maps_equal(grid_map, before)
        assert_maps_equal(again, result)


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


@pytest.mark.parametrize(("type_name", "params"), EVERY_FILTER[4:], ids=lambda v: str(v)[:60])
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


def test_points_that_mirror_each_other_have_an_exactly_horizontal_normal():
    """They lie closest to the plane of the mirror; all that the formula leaves is rounding."""
    heights = [[np.nan, 1.0], [0.5, -3.0], [-3.0, 1.0], [1.0, 0.5]]
    grid_map = terrain((4, 2), 1.0, elevation=heights)
    expected = np.linalg.eigh(np.cov(points_in_disc(grid_map, (2, 0), 2.0).T))[1][:, 0]
    assert abs(expected[2]) < 1e-9
    normal = normals(grid_map, radius=2.0)[2, 0]
    np.testing.assert_allclose(np.abs(normal), np.abs(expected), atol=1e-6)


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


# --- filters against loops over cells -------------------------------------------------------------

WHOLE_CELLS = st.sampled_from([0.0, 0.9, 1.0, 1.5, 2.0, 2.3, 5.0, 8.0])


@given(grid_maps(), WHOLE_CELLS)
@settings(max_examples=40)
def test_min_in_radius_is_the_smallest_finite_value_in_the_disc_of_a_finite_cell(grid_map, cells):
    grid_map.convert_to_default_start_index()
    radius = cells * grid_map.resolution
    params = {"input_layer": "elevation", "output_layer": "out", "radius": radius}
    result = run("MinInRadius", grid_map, **params)["out"]
    expected = oracles.min_in_radius(grid_map["elevation"], grid_map.resolution, radius)
    np.testing.assert_array_equal(result, expected.astype(np.float32))


@given(grid_maps())
@settings(max_examples=60)
def test_curvature_is_minus_the_second_differences(grid_map):
    grid_map.convert_to_default_start_index()
    params = {"input_layer": "elevation", "output_layer": "out"}
    result = run("Curvature", grid_map, **params)["out"]
    expected = oracles.curvature(grid_map["elevation"], grid_map.resolution)
    slack = 1e-6 * 1e3 / grid_map.resolution**2
    np.testing.assert_allclose(result, expected, atol=slack)


def test_a_hilltop_has_positive_curvature_and_a_plane_has_none():
    grid_map = terrain((9, 300))
    x, y = grid_map.geometry.axes()
    grid_map["hill"] = -(x[:, None] ** 2) - y[None, :] ** 2
    grid_map["plane"] = 1000 + 0.5 * x[:, None] + 0.25 * y[None, :]
    for name, expected, atol in (("hill", 4.0, 0.1), ("plane", 0.0, 0.1)):
        result = run("Curvature", grid_map, input_layer=name, output_layer="out")["out"]
        np.testing.assert_allclose(result[1:-1, 1:-1], expected, atol=atol)


class TestMedians:
    """Scattered cells, all cells, and all cells with large windows are computed in other ways."""

    def medians_of(self, layer, cells, half_width):
        output = np.full(layer.shape, -99, np.float32, order="F")
        put_window_medians(output, layer, cells, half_width)
        return output

    @pytest.mark.parametrize("share", [0.1, 0.6, 1.0])
    @pytest.mark.parametrize("half_width", [0, 1, 2, 3, 5, 30])
    @pytest.mark.parametrize("missing", [0.0, 0.2, 0.95, 1.0])
    @pytest.mark.parametrize("size", [(1, 1), (1, 9), (14, 11), (13, 6)], ids=str)
    def test_are_the_upper_medians_of_the_finite_values(self, size, missing, half_width, share):
        random = np.random.default_rng(sum(size) + half_width)
        # Few different values, so that many are equal.
        layer = np.asfortranarray(random.integers(-9, 9, size).astype(np.float32))
        holes = random.random(size) < missing
        layer[holes] = random.choice([np.nan, np.inf, -np.inf], size)[holes]
        cells = np.asfortranarray(random.random(size) < share)
        medians = self.medians_of(layer, cells, half_width)
        for cell in np.ndindex(size):
            expected = -99.0
            if cells[cell]:
                expected = oracles.upper_median(oracles.in_square(layer, half_width, *cell))
            np.testing.assert_array_equal(medians[cell], expected)

    def test_do_not_depend_on_how_the_cells_are_divided_into_pieces(self):
        layer = np.random.default_rng(1).normal(size=(301, 257)).astype(np.float32, order="F")
        layer[::7, ::3] = np.nan
        everywhere = np.ones(layer.shape, dtype=bool, order="F")
        few = np.zeros_like(everywhere)
        few[5::40, 3::30] = True
        for half_width in (2, 6):
            medians = self.medians_of(layer, everywhere, half_width)
            np.testing.assert_array_equal(
                medians[few], self.medians_of(layer, few, half_width)[few]
            )


class TestMedianFill:
    PARAMS = {  # noqa: RUF012
        "input_layer": "elevation",
        "output_layer": "out",
        "fill_hole_radius": 0.2,
        "fill_mask_layer": "mask",
    }

    def fill(self, grid_map, **params):
        return run("MedianFill", grid_map, **self.PARAMS | params)

    @given(grid_maps(), st.integers(0, 5), st.booleans())
    @settings(max_examples=40)
    def test_fills_where_the_closed_mask_says(self, grid_map, iterations, existing):
        grid_map.convert_to_default_start_index()
        layer, resolution = grid_map["elevation"], grid_map.resolution
        result = self.fill(
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

    def test_takes_the_mask_of_the_map_and_computes_none(self):
        heights = np.array([[np.nan, 1, 2], [np.nan, 3, 4], [5, 6, np.nan]])
        grid_map = terrain((3, 3), elevation=heights, mask=[[0.5, 1, 1], [0, 0, 0], [1, 1, np.nan]])
        result = self.fill(grid_map, debug=True, debug_infill_mask_layer="opened")
        assert result.layers == ("elevation", "mask", "out")
        np.testing.assert_array_equal(result["mask"], grid_map["mask"])
        np.testing.assert_array_equal(result["out"], [[4, 1, 2], [np.nan, 3, 4], [5, 6, 4]])

    def test_as_many_iterations_as_one_likes_close_everything(self):
        grid_map = terrain((20, 20), elevation=np.nan)
        grid_map["elevation"][3:6, 3:6] = 1.0
        result = self.fill(grid_map, num_erode_dilation_iterations=2**31, fill_hole_radius=1e9)
        np.testing.assert_array_equal(result["mask"], 1.0)
        np.testing.assert_array_equal(result["out"], 1.0)

    @pytest.mark.parametrize(
        ("params", "message"),
        [
            ({"fill_hole_radius": -0.1}, "'fill_hole_radius': expected a length >= 0"),
            ({"filter_existing_values": True}, "needs an 'existing_value_radius'"),
            ({"existing_value_radius": np.inf}, "'existing_value_radius': expected a length >= 0"),
            ({"debug": True}, "needs a 'debug_infill_mask_layer'"),
            ({"num_erode_dilation_iterations": -1}, "expected an integer >= 0, found -1"),
        ],
    )
    def test_refuses_parameters_that_make_no_sense(self, params, message):
        with pytest.raises(FilterConfigError, match=message):
            self.fill(terrain(elevation=0.0), **params)


# --- colours --------------------------------------------------------------------------------------


def assert_bytes_near(color, expected):
    """Fractions of 1/255 are cut off, and rounding may decide which."""
    cut_off = np.clip(expected, 0, 255) - oracles.to_bytes(color)
    assert cut_off.min() > -1e-3
    assert cut_off.max() < 1 + 1e-3


class TestColorMap:
    PARAMS = {  # noqa: RUF012
        "input_layer": "a",
        "output_layer": "color",
        "min_value": -1.0,
        "max_value": 3.0,
        "min_color": [0.0, 1.0, 0.25],
        "max_color": [1.0, 0.0, 0.5],
    }

    def test_is_a_ramp_that_is_flat_beyond_its_ends(self):
        values = np.array([[-np.inf, np.nan, -9, -1, 0, 1, 2.5, 3, 9, np.inf]])
        colors = run("ColorMap", terrain(values.shape, a=values), **self.PARAMS)["color"][0]
        assert np.isnan(colors[[0, 1, 9]]).all()
        assert oracles.to_bytes(colors[2]) == oracles.to_bytes(colors[3]) == (0, 255, 63)
        assert oracles.to_bytes(colors[7]) == oracles.to_bytes(colors[8]) == (255, 0, 127)
        for number in (4, 5, 6):
            share = (values[0, number] + 1) / 4
            assert_bytes_near(colors[number], 255 * np.array([share, 1 - share, (1 + share) / 4]))

    @pytest.mark.parametrize(
        "spelling",
        [
            {
                "min": {"value": -1, "color": [0, 1, 0.25]},
                "max": {"value": 3, "color": [1, 0, 0.5]},
            },
            {
                "min/value": -1,
                "min/color": [0, 1, 0.25],
                "max/value": 3.0,
                "max/color": [1, 0, 0.5],
            },
            {"min.value": -1, "min": {"color": [0, 1, 0.25]}, "max_value": 3}
            | {"max/color": [1, 0, 0.5]},
        ],
        ids=["nested", "ROS 1", "mixed"],
    )
    def test_its_parameters_have_several_spellings(self, spelling):
        grid_map = terrain((4, 3), a=np.linspace(-2, 4, 12).reshape(4, 3))
        names = {"input_layer": "a", "output_layer": "color"}
        result = run("ColorMap", grid_map, **names, **spelling)
        assert_maps_equal(result, run("ColorMap", grid_map, **self.PARAMS))

    def test_two_spellings_of_one_parameter_are_an_error(self):
        with pytest.raises(FilterConfigError, match="'min_value' is given twice"):
            run("ColorMap", terrain(a=0.0), **self.PARAMS, **{"min/value": 2.0})

    @pytest.mark.parametrize(
        ("params", "message"),
        [
            ({"max_value": -1.0}, "'max/value': expected a finite number above min/value, -1.0"),
            ({"max_value": np.inf}, "'max/value': expected a finite number above"),
            ({"min_value": -np.inf}, "'min/value': expected a finite number"),
            ({"min_color": [0, 1]}, "'min/color': expected three finite numbers"),
            ({"max_color": [0, 1, np.nan]}, "'max/color': expected three finite numbers"),
        ],
    )
    def test_refuses_what_is_no_ramp(self, params, message):
        with pytest.raises(FilterConfigError, match=message):
            run("ColorMap", terrain(a=0.0), **self.PARAMS | params)


def test_light_is_brightest_where_it_falls_straight_onto_the_surface():
    normals = {
        "n_x": [[0, 1, 0, 0.6, np.nan]],
        "n_y": [[0, 0, 0, 0, 0]],
        "n_z": [[1, 0, -1, 0.8, 1]],
    }
    grid_map = terrain((1, 5), **normals)
    params = {"input_layers_prefix": "n_", "output_layer": "color"}
    color = run("LightIntensity", grid_map, light_direction=[0, 0, -7], **params)["color"][0]
    expected = [(255,) * 3, (0,) * 3, (0,) * 3, (204,) * 3]
    assert [oracles.to_bytes(one) for one in color[:4]] == expected
    assert np.isnan(color[4])
    for direction in ([0, 0, 0], [1, 2], [0, 0, np.inf]):
        with pytest.raises(FilterConfigError, match="'light_direction': expected three finite"):
            run("LightIntensity", grid_map, light_direction=direction, **params)


def test_color_fill_colours_all_cells_or_those_with_data_in_the_mask():
    grid_map = terrain((1, 4), mask=[[1, np.nan, np.inf, -3]])
    params = {"red": 0.2, "green": 2, "blue": -1, "output_layer": "color"}
    everywhere = run("ColorFill", grid_map, **params)["color"]
    assert {oracles.to_bytes(color) for color in everywhere.flat} == {(51, 255, 0)}
    masked = run("ColorFill", grid_map, mask_layer="mask", **params)["color"][0]
    np.testing.assert_array_equal(np.isnan(masked), [False, True, True, False])
    assert {oracles.to_bytes(color) for color in masked[[0, 3]]} == {(51, 255, 0)}
    with pytest.raises(FilterConfigError, match="'red, green, blue': expected three finite"):
        run("ColorFill", grid_map, **params | {"red": np.nan})


class TestColorBlending:
    def blend(self, below, above, **params):
        grid_map = terrain(below.shape, below=below, above=above)
        layers = {"background_layer": "below", "foreground_layer": "above", "output_layer": "out"}
        return run("ColorBlending", grid_map, **layers, **params)["out"]

    @pytest.mark.parametrize("mode", ["normal", "hard_light", "soft_light"])
    @given(opacity=st.floats(0, 1), seed=st.integers(0, 1000))
    @settings(max_examples=20)
    def test_mixes_cell_by_cell(self, mode, opacity, seed):
        random = np.random.default_rng(seed)
        below, above = (color_vector_to_value(random.random((6, 4, 3))) for _ in range(2))
        result = self.blend(below, above, blend_mode=mode, opacity=opacity)
        for cell in np.ndindex(result.shape):
            channels = oracles.blend(below[cell], above[cell], mode, opacity)
            assert_bytes_near(result[cell], channels)

    @pytest.mark.parametrize("mode", ["normal", "hard_light", "soft_light"])
    def test_takes_the_other_colour_where_there_is_one_only(self, mode):
        red, blue = color_vector_to_value([[1.0, 0, 0], [0, 0, 1.0]])
        below, above = np.array([[red, np.nan, np.nan]]), np.array([[np.nan, blue, np.nan]])
        result = self.blend(below, above, blend_mode=mode, opacity=0.3)
        np.testing.assert_array_equal(result, [[red, blue, np.nan]])

    def test_mixes_normally_by_default_and_refuses_other_opacities(self):
        below, above = (
            color_vector_to_value([[[0.0, 0, 0]]]),
            color_vector_to_value([[[1.0, 1, 1]]]),
        )
        assert oracles.to_bytes(self.blend(below, above, opacity=0.5)[0, 0]) == (127,) * 3
        for opacity in (-0.1, 1.5, np.nan):
            with pytest.raises(
                FilterConfigError, match=r"'opacity': expected a number in \[0, 1\]"
            ):
                self.blend(below, above, opacity=opacity)


def test_basic_layers_are_set_and_missing_ones_are_a_warning():
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
