# SPDX-License-Identifier: BSD-3-Clause
"""Distances to the surface of a height layer, against loops over all columns."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.interpolate import RegularGridInterpolator

import golden
from grid_map_core_py import GeometryError, GridMap, GridMapError, LayerNotFoundError
from grid_map_core_py.map import SignedDistanceField
from grid_map_core_py.testing import grid_maps

ROUND_OFF = {"rtol": 1e-6, "atol": 1e-6}


def hills(rows=9, columns=6, resolution=0.1, position=(3.0, -2.0)):
    grid_map = GridMap(
        np.multiply((rows, columns), resolution), resolution, position, frame_id="odom"
    )
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    grid_map["elevation"] = 0.3 * np.sin(7 * x) * np.cos(5 * y)
    return grid_map


def hills_field(**options):
    return SignedDistanceField(hills(**options), "elevation", -0.5, 0.5)


def flat(size=(4, 3), height=0.25):
    return GridMap(np.multiply(size, 0.1), 0.1, layers={"elevation": height})


def columns_of(grid_map):
    """Return [(x, y, height)] of all cells, row by row of the map."""
    x, y = grid_map.geometry.axes_in_map_order()
    heights = grid_map.unwrapped("elevation").tolist()
    return [
        (x[row], y[column], heights[row][column])
        for row in range(x.size)
        for column in range(y.size)
    ]


def gap(upper, lower):
    """Return `upper - lower`; 0 for equal infinities."""
    return 0.0 if upper <= lower else upper - lower


def distance_of_node(columns, number, z):
    """Return the signed distance of the point at height z over a column."""
    x, y, height = columns[number]
    if z > height:
        return min(math.hypot(x - cx, y - cy, gap(z, top)) for cx, cy, top in columns)
    return 0.0 - min(math.hypot(x - cx, y - cy, gap(top, z)) for cx, cy, top in columns)


def distances_of_nodes(grid_map, levels):
    columns = columns_of(grid_map)
    nodes = [distance_of_node(columns, i, z) for i in range(len(columns)) for z in levels.tolist()]
    return np.reshape(nodes, (*grid_map.size, levels.size))


def trilinear(field):
    """Return an independent trilinear interpolation between the nodes of a field."""
    x, y = field.geometry.axes_in_map_order()
    return RegularGridInterpolator(
        (x[::-1], y[::-1], field.levels),
        field.distances[::-1, ::-1].astype(np.float64),
        bounds_error=False,
        fill_value=None,
    )


def nodes_of(field):
    """Return the positions (rows, cols, levels, 3) of the nodes."""
    x, y = field.geometry.axes_in_map_order()
    return np.stack(np.meshgrid(x, y, field.levels, indexing="ij"), axis=-1)


def points_around(field, margin, number=500):
    nodes = nodes_of(field).reshape(-1, 3)
    random = np.random.default_rng(5)
    return random.uniform(nodes.min(axis=0) - margin, nodes.max(axis=0) + margin, (number, 3))


# At the nodes


@given(
    grid_maps(max_side=5),
    st.sampled_from([1.0, 1e-2, 1e-3]),
    st.floats(-2, 2),
    st.floats(0.1, 4),
)
def test_node_distances_equal_a_loop_over_all_columns(grid_map, scale, low, levels):
    grid_map["elevation"] = scale * grid_map["elevation"]
    before = grid_map.copy()
    high = low + levels * grid_map.resolution
    field = SignedDistanceField(grid_map, "elevation", low, high, unknown="free")
    np.testing.assert_array_equal(grid_map["elevation"], before["elevation"])

    columns = grid_map.copy()
    columns["elevation"][np.isnan(columns["elevation"])] = -np.inf
    expected = distances_of_nodes(columns, field.levels)
    np.testing.assert_allclose(field.distances, expected, **ROUND_OFF)
    found = field.value(nodes_of(field).reshape(-1, 3))
    np.testing.assert_allclose(found, expected.ravel(), **ROUND_OFF)


def test_nodes_of_larger_maps_have_exact_distances():
    grid_map = hills(rows=40, columns=23)
    field = SignedDistanceField(grid_map, "elevation", -0.6, 0.9)
    columns = columns_of(grid_map)
    for number in range(0, len(columns), 37):
        found = field.distances.reshape(-1, field.levels.size)[number]
        expected = [distance_of_node(columns, number, z) for z in field.levels.tolist()]
        np.testing.assert_allclose(found, expected, **ROUND_OFF)


def test_large_heights_keep_precision():
    grid_map = flat(height=4000.0)
    field = SignedDistanceField(grid_map, "elevation", 3999.95, 4001.0)
    expected = np.broadcast_to(field.levels - 4000.0, field.shape)
    np.testing.assert_allclose(field.distances, expected, **ROUND_OFF)


def test_on_top_of_its_column_a_node_has_distance_zero():
    step = GridMap((1.2, 0.3), 0.1)
    step["elevation"] = np.repeat(step.axes()[0][:, None] > 0, 3, axis=1)
    field = SignedDistanceField(step, "elevation", 0.0, 2.0)
    tops = field.value([(-0.35, 0, 0.0), (0.35, 0, 1.0)])
    np.testing.assert_array_equal(tops, [0.0, 0.0])
    assert not np.signbit(field.distances[field.distances == 0]).any()


# The C++ library


def golden_cases():
    """Cases that the golden README calls right: maps without NaN."""
    family = golden.load("sdf")
    for case in family["cases"]:
        grid_map = golden.to_map(family["maps"][case["map"]])
        if np.isfinite(grid_map[case["layer"]]).all():
            yield case, grid_map


def golden_nodes():
    """Yield what C++ and we find at nodes between the lowest and the highest cell, and columns."""
    for case, grid_map in golden_cases():
        heights = grid_map[case["layer"]].astype(np.float64)
        grid_map["elevation"] = heights
        low = case["z_index_start_height"]
        high = low + (case["n_levels"] - 1) * case["resolution"]
        field = SignedDistanceField(grid_map, case["layer"], low, high)
        assert field.levels.size == case["n_levels"]
        columns = columns_of(grid_map)
        for level, z in enumerate(field.levels.tolist()):
            if heights.min() < z < heights.max():
                ours = field.distances[:, :, level].ravel()
                yield np.ravel(case["data"][level]), ours, columns, z


def sideways_or_straight(columns, number, z):
    """Return the shorter distance to the surface: along the level or along the column."""
    x, y, height = columns[number]
    ways = [math.hypot(x - cx, y - cy) for cx, cy, top in columns if (z > top) != (z > height)]
    return math.copysign(min(ways + [abs(z - height)]), z - height)


def test_nodes_equal_cpp_if_nearest_point_is_not_oblique():
    compared = oblique = 0
    for cpp, ours, columns, z in golden_nodes():
        for number in range(len(columns)):
            exact = distance_of_node(columns, number, z)
            np.testing.assert_allclose(ours[number], exact, **ROUND_OFF)
            if abs(abs(exact) - abs(sideways_or_straight(columns, number, z))) <= 1e-9:
                np.testing.assert_allclose(cpp[number], ours[number], **ROUND_OFF)
                compared += 1
            else:
                # C++ searches along level and column only, and gets larger distances.
                assert abs(cpp[number]) > abs(ours[number])
                oblique += 1
    assert (compared, oblique) == (753, 151)


# Between and beyond the nodes


@pytest.mark.parametrize(("margin", "tolerance"), [(0.0, 1e-6), (1.0, 1e-5)])
def test_values_are_trilinear_between_the_nodes(margin, tolerance):
    """Values outside of the nodes are extrapolated linearly."""
    field = hills_field()
    points = points_around(field, margin)
    np.testing.assert_allclose(field.value(points), trilinear(field)(points), 1e-6, tolerance)


@given(grid_maps(max_side=4, allow_nan=False, allow_infinity=False))
def test_a_single_row_or_column_makes_the_field_constant_across(grid_map):
    grid_map["elevation"] *= np.float32(1e-3)
    field = SignedDistanceField(grid_map, "elevation", -0.3, 0.2)
    points = points_around(field, 0.5, 20)
    for axis in (0, 1):
        if grid_map.size[axis] == 1:
            shifted = points.copy()
            shifted[:, axis] += 7.0
            np.testing.assert_array_equal(field.value(shifted), field.value(points))
            np.testing.assert_array_equal(field.gradient(points)[:, axis], 0)
    assert np.isfinite(field.value(points)).all()


def test_nearest_value_is_of_the_nearest_node():
    field = hills_field()
    points = points_around(field, 0.4)
    distances = np.linalg.norm(points[:, None] - nodes_of(field).reshape(-1, 3), axis=-1)
    expected = field.distances.ravel()[distances.argmin(axis=1)]
    np.testing.assert_array_equal(field.nearest_value(points), expected)
    assert field.nearest_value(points[3]) == expected[3]
    assert math.isnan(field.nearest_value((3.0, np.nan, 0.0)))


def test_gradients_are_finite_differences_of_the_values():
    field = hills_field()
    points = points_around(field, 0.3)
    first, h = nodes_of(field)[-1, -1, 0], 0.01
    within = np.mod((points - first) / 0.1, 1)
    points = points[((within > 0.15) & (within < 0.85)).all(axis=1)]
    assert len(points) > 100
    expected = np.empty_like(points)
    for axis in range(3):
        offset = h * np.eye(3)[axis]
        difference = field.value(points + offset) - field.value(points - offset)
        expected[:, axis] = difference / (2 * h)
    np.testing.assert_allclose(field.gradient(points), expected, atol=1e-4)


def test_at_a_node_the_gradient_is_the_central_difference():
    field = hills_field()
    nodes, d = nodes_of(field), field.distances.astype(np.float64)
    # np.gradient is one-sided at the faces.
    along = np.gradient(d, -0.1, -0.1, 0.1)
    expected = np.stack(along, axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(field.gradient(nodes.reshape(-1, 3)), expected, atol=1e-5)
    off = nodes.reshape(-1, 3) + 5e-10
    np.testing.assert_allclose(field.gradient(off), expected, atol=1e-5)


def test_value_and_gradient_equal_separate_calls():
    field = hills_field()
    points = points_around(field, 0.3, 40_000)
    values, gradients = field.value_and_gradient(points)
    np.testing.assert_allclose(values, field.value(points), **ROUND_OFF)
    np.testing.assert_array_equal(gradients, field.gradient(points))
    for number in (0, 17_000, 39_999):
        assert field.value(points[number]) == field.value(points)[number]
        np.testing.assert_array_equal(field.gradient(points[number]), gradients[number])


# Points


def test_one_point_gives_a_float_and_many_give_an_array():
    field = hills_field()
    assert isinstance(field.value([3, -2, 0]), float)
    assert field.gradient((3, -2, 0)).shape == (3,)
    value, gradient = field.value_and_gradient(np.array([3, -2, 0], dtype=np.float32))
    assert isinstance(value, float)
    assert gradient.shape == (3,)
    assert field.value([[3, -2, 0]]).shape == (1,)
    assert field.value(np.empty((0, 3))).shape == (0,)
    assert field.gradient(np.empty((0, 3))).shape == (0, 3)
    assert field.value([[3, -2, 0]]).dtype == np.float64


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_point_that_is_not_finite_gives_nan(axis, number):
    field = hills_field()
    points = np.tile([3.0, -2.0, 0.1], (3, 1))
    points[1, axis] = number
    values, gradients = field.value_and_gradient(points)
    assert np.isnan(values).tolist() == [False, True, False]
    assert np.isnan(gradients[1]).all()
    assert np.isfinite(gradients[[0, 2]]).all()
    np.testing.assert_array_equal(field.value(points), values)
    assert np.isnan(field.nearest_value(points)).tolist() == [False, True, False]


@pytest.mark.parametrize("points", [(1, 2), 5.0, np.zeros((4, 2)), np.zeros((2, 2, 3)), "abc"])
def test_points_of_another_shape_are_refused(points):
    with pytest.raises(GeometryError, match="points: expected"):
        hills_field().value(points)


# Heights and levels


def test_missing_data_is_an_error_that_suggests_inpainting():
    grid_map = hills()
    grid_map["elevation"][2:4, 3] = np.nan
    message = "layer 'elevation': 2 of 54 cells are NaN; inpaint them first"
    with pytest.raises(GridMapError, match=message):
        SignedDistanceField(grid_map, "elevation", 0.0, 1.0)
    with pytest.raises(GridMapError, match="unknown: expected None or 'free', got 'filled'"):
        SignedDistanceField(grid_map, "elevation", 0.0, 1.0, unknown="filled")
    with pytest.raises(LayerNotFoundError, match="no layer 'height'; available: elevation"):
        SignedDistanceField(grid_map, "height", 0.0, 1.0)


@pytest.mark.parametrize(
    ("height", "distance"), [(np.nan, np.inf), (-np.inf, np.inf), (np.inf, -np.inf)]
)
def test_without_a_surface_every_distance_is_infinite(height, distance):
    field = SignedDistanceField(flat(height=height), "elevation", 0.0, 1.0, unknown="free")
    assert (field.distances == distance).all()
    values, gradients = field.value_and_gradient([(0, 0, 0.5), (9, 9, 9), (np.nan, 0, 0)])
    np.testing.assert_array_equal(values, [distance, distance, np.nan])
    np.testing.assert_array_equal(gradients, [[0, 0, 0], [0, 0, 0], [np.nan] * 3])
    assert field.value((0, 0, 0.5)) == field.nearest_value((0, 0, 0.5)) == distance


@pytest.mark.parametrize(
    ("low", "high", "levels"),
    [(0.0, 0.3, 4), (0.0, 0.31, 5), (-0.5, 0.1, 7), (0.3, 0.3, 2), (0, 1, 11)],
)
def test_levels_are_one_resolution_apart_and_cover_the_heights(low, high, levels):
    field = SignedDistanceField(flat(), "elevation", low, high)
    assert field.shape == (4, 3, levels)
    np.testing.assert_allclose(field.levels, low + 0.1 * np.arange(levels))
    assert field.levels[-1] >= high - 1e-9


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ((1.0, 0.0), "max_height: expected a finite number >= 1, got 0.0"),
        ((np.nan, 1.0), "min_height: expected a finite number, got nan"),
        ((0.0, np.inf), "max_height: expected a finite number >= 0, got inf"),
        ((-np.inf, 0.0), "min_height: expected a finite number, got -inf"),
        ((0.0, "high"), "max_height: expected a number"),
        ((-1e9, 1e9), r"a field of at most 2\*\*31 nodes, got 4 x 3 x "),
        ((-1.7e308, 1.7e308), r"a field of at most 2\*\*31 nodes, got 4 x 3 x "),
    ],
)
def test_limits_must_be_finite_numbers_in_order(limits, message):
    with pytest.raises(GeometryError, match=message):
        SignedDistanceField(flat(), "elevation", *limits)


# Properties and export


def test_the_field_knows_its_frame_and_keeps_its_data():
    grid_map = hills()
    grid_map.timestamp = 7
    field = SignedDistanceField(grid_map, "elevation", -0.5, 0.5)
    before = field.distances.copy()
    grid_map["elevation"] = 9.0
    grid_map.position = (0.0, 0.0)
    np.testing.assert_array_equal(field.distances, before)
    assert (field.frame_id, field.timestamp, field.resolution) == ("odom", 7, 0.1)
    np.testing.assert_allclose(field.geometry.position, (3.0, -2.0))
    assert field.distances.dtype == np.float32
    for array in (field.distances, field.levels):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert repr(field) == (
        "SignedDistanceField(9 x 6 x 11 nodes of 0.1 m, z from -0.5 to 0.5 m, in 'odom')"
    )


def test_points_are_the_nodes_and_their_distances():
    field = hills_field()
    points = field.to_points()
    assert points.dtype == np.float32
    assert points.shape == (9 * 6 * 11, 4)
    np.testing.assert_allclose(points[:, :3], nodes_of(field).reshape(-1, 3), **ROUND_OFF)
    np.testing.assert_array_equal(points[:, 3], field.distances.ravel())
    near = field.to_points(lower=-0.05, upper=0.1)
    chosen = (points[:, 3] >= -0.05) & (points[:, 3] <= 0.1)
    assert 0 < len(near) < len(points)
    np.testing.assert_array_equal(near, points[chosen])
    assert field.to_points(upper=-10.0).shape == (0, 4)
    for limits in ({"lower": None}, {"upper": "near"}):
        with pytest.raises(GeometryError, match="er: expected a number"):
            field.to_points(**limits)
