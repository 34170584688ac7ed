# SPDX-License-Identifier: BSD-3-Clause
"""Layers made of point clouds."""

import statistics
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as arrays

from grid_map_core_py import (
    ConfigError,
    GeometryError,
    GridMap,
    GridMapError,
    color_value_to_vector,
    color_vector_to_value,
)
from grid_map_core_py._arrays._checks import as_points
from grid_map_core_py.conversions import from_points, rasterize
from grid_map_core_py.conversions._point_layers import fitting_geometry
from grid_map_core_py.testing import assert_maps_equal, grid_maps

ORACLES = {
    "max": max,
    "min": min,
    "mean": statistics.fmean,
    "median": statistics.median,
    "first": lambda values: values[0],
    "last": lambda values: values[-1],
    "count": len,
    "variance": statistics.pvariance,
}
ALL = {reduction: reduction for reduction in ORACLES}

SPECIAL = st.sampled_from([np.nan, np.inf, -np.inf])


def clouds(reach: float = 1.25) -> st.SearchStrategy[np.ndarray]:
    """Points around the origin, some at the same place, some not finite."""
    numbers = st.floats(-reach, reach, width=32) | st.sampled_from([0.0, -0.0, 0.5, -0.5]) | SPECIAL
    shapes = st.tuples(st.integers(0, 40), st.just(3))
    return arrays.arrays(np.float64, shapes, elements=numbers)


def around(grid_map: GridMap, cloud: np.ndarray) -> np.ndarray:
    """Return the cloud stretched to the place and size of a map; 0.5 is its border."""
    cloud = cloud.copy()
    cloud[:, :2] = grid_map.position + cloud[:, :2] * grid_map.length
    return cloud


def reduce_by_hand(grid_map, points, values, low=-np.inf, high=np.inf) -> dict[str, np.ndarray]:
    """Oracle: collect the values in one list per cell, then reduce each list in Python."""
    members = {}
    for (x, y, z), value in zip(points[:, :3].tolist(), values.tolist(), strict=True):
        counts = np.isfinite([x, y, z, value]).all() and low <= z <= high
        if counts and grid_map.is_inside((x, y)):
            members.setdefault(grid_map.get_index((x, y)), []).append(value)
    layers = {name: np.full(grid_map.size, np.nan) for name in ORACLES}
    layers["count"][...] = 0
    for cell, inside in members.items():
        for name, oracle in ORACLES.items():
            layers[name][cell] = oracle(inside)
    return layers


height_limits = st.none() | st.tuples(st.floats(-1, 1), st.floats(0, 1))


@given(grid_maps(), clouds(), height_limits)
def test_heights_within_limits_equal_sorting_by_hand(grid_map, cloud, limits):
    points = around(grid_map, cloud)
    low, high = (limits[0], sum(limits)) if limits else (-np.inf, np.inf)
    result = rasterize(points, grid_map, ALL, min_height=low, max_height=high)
    for name, expected in reduce_by_hand(grid_map, points, points[:, 2], low, high).items():
        np.testing.assert_allclose(result[name], expected, rtol=1e-6, atol=1e-12, err_msg=name)
        assert result[name].dtype == np.float32
        assert result[name].flags.f_contiguous


def unaligned(points: np.ndarray) -> np.ndarray:
    memory = np.zeros(points.nbytes + 1, np.uint8)[1:]
    copy = memory.view(points.dtype).reshape(points.shape)
    copy[...] = points
    return copy


LAYOUTS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "rows": np.ascontiguousarray,
    "columns": np.asfortranarray,
    "wide": lambda points: np.column_stack([points, points, points])[:, 3:],
    "every second": lambda points: np.repeat(points, 2, axis=0)[::2],
    "backwards": lambda points: np.ascontiguousarray(points[::-1])[::-1],
    "float64": lambda points: points.astype(np.float64),
    "unaligned": unaligned,
}


@given(grid_maps(), clouds(), st.sampled_from([*LAYOUTS]))
def test_memory_order_of_points_does_not_matter(grid_map, cloud, layout):
    points = around(grid_map, cloud).astype(np.float32)
    expected = rasterize(points, grid_map, ALL)
    assert_maps_equal(rasterize(LAYOUTS[layout](points), grid_map, ALL), expected)


@given(grid_maps(max_side=4), clouds(), st.data())
def test_fields_equal_sorting_by_hand(grid_map, cloud, data):
    points = around(grid_map, cloud)
    numbers = st.floats(-9, 9, width=32) | SPECIAL
    values = data.draw(arrays.arrays(np.float64, len(points), elements=numbers))
    fields = dict.fromkeys(ORACLES, values)
    result = rasterize(points, grid_map, {}, fields=fields, field_reductions=ALL)
    for name, expected in reduce_by_hand(grid_map, points, values).items():
        np.testing.assert_allclose(result[name], expected, rtol=1e-6, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("offset", [0.0, 1e4, -1e6])
def test_variance_and_mean_keep_precision_far_from_zero(offset):
    rng = np.random.default_rng(3)
    points = np.zeros((5000, 3))
    points[:, 2] = offset + rng.normal(0, 0.01, 5000)
    result = rasterize(points, GridMap((1, 1), 1.0), {"v": "variance", "m": "mean"})
    np.testing.assert_allclose(result["v"], statistics.pvariance(points[:, 2].tolist()), rtol=1e-6)
    np.testing.assert_allclose(result["m"], statistics.fmean(points[:, 2].tolist()), rtol=1e-7)


def test_lists_integers_and_masked_points_are_taken():
    grid_map = GridMap((4, 4), 1.0)
    expected = rasterize(np.array([(1.0, 1.0, 3.0)]), grid_map)
    assert_maps_equal(rasterize([[1, 1, 3]], grid_map), expected)
    assert_maps_equal(rasterize(np.array([[1, 1, 3]]), grid_map), expected)
    masked = np.ma.masked_invalid([[1, 1, 3], [1, 1, np.inf]])
    assert_maps_equal(rasterize(masked, grid_map), expected)
    assert as_points(np.zeros((2, 3), np.float32)).dtype == np.float32


def test_the_input_is_not_changed_and_other_layers_are_shared():
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    before = points.copy()
    grid_map = GridMap((2, 2), 0.5, layers={"elevation": 7.0, "other": 1.0}, frame_id="map")
    result = rasterize(points, grid_map, {"elevation": "min"})
    np.testing.assert_array_equal(points, before)
    assert (grid_map["elevation"] == 7).all()
    assert np.shares_memory(result._layers["other"], grid_map["other"])
    assert result.frame_id == "map"


# Colors


def test_mean_of_colors_averages_channels():
    rgb = np.array([(10, 200, 0), (21, 100, 255), (0, 0, 8), (0, 0, 0)], np.uint8)
    points = [(0.5, 0.5, 0), (0.5, 0.5, 0), (-0.5, -0.5, 0), (0.5, -0.5, 0)]
    packed = color_vector_to_value(rgb)
    opaque = packed.view(np.uint32) | np.uint32(0xFF << 24)
    for colors in (packed, packed.astype(float), packed.view(np.uint32), opaque, opaque.view("f4")):
        result = rasterize(points, GridMap((2, 2), 1.0), {}, fields={"rgb": colors})["rgb"]
        channels = np.rint(255 * color_value_to_vector(result)).tolist()
        assert channels[0][0] == [16, 150, 128]
        assert channels[1][1] == [0, 0, 8]
        assert result[0, 1] == 0  # black
        assert np.isnan(result[1, 0])


def test_first_and_last_keep_color_bits_of_every_color():
    colors = np.array([np.nan, 3e-39, 1e-40, -np.nan], np.float32)
    points = np.zeros((4, 3))
    for reduction, expected in (("first", colors[1]), ("last", colors[2]), ("count", 2.0)):
        options = {"fields": {"color": colors}, "field_reductions": {"color": reduction}}
        result = rasterize(points, GridMap((1, 1), 1.0), {}, **options)
        assert result["color"] == np.float32(expected)


# Maps fitted to clouds


@given(
    clouds(),
    st.sampled_from([0.05, 0.1, 0.3, 1.0]),
    st.floats(-50, 50) | st.sampled_from([5e6, -4.5e5]),
)
def test_fitted_map_holds_every_point_and_no_spare_row(cloud, resolution, shift):
    cloud = cloud + (shift, -shift, 0)
    finite = cloud[np.isfinite(cloud).all(axis=1)]
    if not len(finite):
        with pytest.raises(GridMapError, match="points: expected a finite one"):
            from_points(cloud, resolution, tight=True)
        return
    grid_map = from_points(cloud, resolution, {"n": "count"}, tight=True)
    assert grid_map["n"].sum() == len(finite)
    extent = np.ptp(finite[:, :2], axis=0)
    assert (grid_map.length - extent <= 1.001 * resolution).all()
    middle = 0.5 * (finite[:, :2].min(axis=0) + finite[:, :2].max(axis=0))
    np.testing.assert_allclose(grid_map.position, middle, rtol=1e-15, atol=1e-9)


@given(
    clouds(),
    clouds(),
    st.sampled_from([0.05, 0.1, 0.3, 1.0]),
    st.floats(-50, 50) | st.sampled_from([0.0, 5e6, -4.5e5]),
)
def test_maps_of_two_clouds_share_their_cells(first, second, resolution, shift):
    rounding = 1e-9 + 1e-14 * abs(shift)
    maps = []
    for cloud in (first, second + (shift, -shift, 0)):
        finite = cloud[np.isfinite(cloud).all(axis=1)]
        if not len(finite):
            return
        grid_map = from_points(cloud, resolution, {"n": "count"})
        assert grid_map["n"].sum() == len(finite)
        for border in (grid_map.geometry.corner, grid_map.geometry.corner - grid_map.length):
            off = border - resolution * np.round(border / resolution)
            assert np.abs(off).max() <= rounding
        # No row or column is spare, apart from rounding.
        lower, upper = finite[:, :2].min(axis=0), finite[:, :2].max(axis=0)
        corner = grid_map.geometry.corner
        assert (corner - upper <= resolution + rounding).all()
        assert (lower - (corner - grid_map.length) <= resolution + rounding).all()
        maps.append(grid_map)
    if abs(shift) <= 50:
        whole, other = maps
        total = whole["n"].sum() + other["n"].sum()
        whole.extend_to_include(other)
        shared, inside = whole.get_indices(other.get_positions())
        assert inside.all()
        both = np.nan_to_num(whole["n"])
        np.add.at(both, shared, other["n"].ravel("F"))
        assert both.sum() == total
        np.testing.assert_allclose(
            whole.get_positions(shared), other.get_positions(), rtol=0, atol=1e-9
        )


@pytest.mark.parametrize("hold_edges", [False, True])
@pytest.mark.parametrize(
    ("lower", "upper", "size", "position"),
    [
        ((0.01, -0.04), (0.29, 0.06), (3, 2), (0.15, 0.0)),
        ((-7.6e-06, 0.0001), (0.2, 0.1), (3, 1), (0.05, 0.05)),
        ((0.15, 0.15), (0.15, 0.15), (1, 1), (0.15, 0.15)),
    ],
)
def test_aligned_grid_has_borders_at_multiples(hold_edges, lower, upper, size, position):
    geometry = fitting_geometry(
        np.array(lower), np.array(upper), 0.1, hold_edges=hold_edges, align=True
    )
    assert geometry.size == size
    np.testing.assert_allclose(geometry.position, position, rtol=0, atol=1e-12)
    on_borders = fitting_geometry(
        np.zeros(2), np.array([0.3, 0.6]), 0.1, hold_edges=hold_edges, align=True
    )
    assert on_borders.size == ((4, 7) if hold_edges else (3, 6))


def test_points_on_a_lattice_get_a_cell_each():
    x, y = np.meshgrid(np.arange(11) * 0.1, np.arange(6) * 0.1)
    points = np.column_stack([x.ravel(), y.ravel(), x.ravel()])
    grid_map = from_points(points, 0.1, {"n": "count"}, tight=True, frame_id="odom", timestamp=5)
    assert grid_map.size == (11, 6)
    assert (grid_map["n"] == 1).all()
    assert (grid_map.frame_id, grid_map.timestamp) == ("odom", 5)


def test_length_and_position_may_be_given():
    points = [(0.2, 0.3, 1.0), (1.4, 2.1, 2.0), (1.4, 2.1, np.nan)]
    whole = from_points(points, 0.5, length=(4, 2), position=(1, 1))
    assert whole.size == (8, 4)
    np.testing.assert_allclose(whole.position, (1, 1))
    assert np.isfinite(whole["elevation"]).sum() == 1
    centered = from_points(points, 0.5, length=(4, 2))
    np.testing.assert_allclose(centered.position, (0.8, 1.2))
    around_origin = from_points(points, 0.5, {"n": "count"}, position=(0, 0))
    np.testing.assert_allclose(around_origin.position, (0, 0))
    assert around_origin["n"].sum() == 2
    assert around_origin.size == (6, 9)


def test_stray_point_far_away_is_refused_with_a_reason():
    with pytest.raises(GridMapError, match="expected at most 16000000 cells, got"):
        from_points([(0, 0, 0), (1e30, 1, 0)], 0.1)
    with pytest.raises(GridMapError, match="expected at most 16000000 cells, got inf x 1"):
        from_points([(-1.7e308, 0, 0), (1.7e308, 1, 0)], 0.1)


# Bad input

GRID = GridMap((1, 1), 0.5, layers={"elevation": 1.0})


@pytest.mark.parametrize(
    "points", [[1, 2, 3], [[1, 2]], np.zeros((2, 2, 3)), [], [["a", "b", "c"]], None, [[1j, 0, 0]]]
)
def test_points_must_be_x_y_z(points):
    with pytest.raises(GeometryError, match="points: expected"):
        rasterize(points, GRID)


@pytest.mark.parametrize("reduction", ["mode", "", None, 3])
def test_error_of_unknown_reduction_lists_reductions(reduction):
    with pytest.raises(ConfigError, match=r"reduction of z.*one of max, min, mean, median"):
        rasterize([[0, 0, 0]], GRID, {"z": reduction})


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"min_height": 1, "max_height": 0},
            ConfigError,
            "min_height, max_height: expected ascending limits",
        ),
        ({"min_height": np.nan}, ConfigError, "min_height, max_height: expected ascending limits"),
        ({"max_height": "x"}, GeometryError, "max_height: expected a number"),
        ({"fields": {"i": [1, 2]}}, GeometryError, r"field 'i': expected shape \(1,\), got \(2,\)"),
        ({"fields": {"i": ["a"]}}, GeometryError, "field 'i': expected numbers"),
        ({"fields": {"rgb": ["a"]}}, GeometryError, "field 'rgb': expected numbers"),
        (
            {"fields": {"elevation": [1]}},
            GridMapError,
            "fields: expected other names .* got 'elevation'",
        ),
        ({"layers": "elevation"}, ConfigError, "'layers': expected a mapping"),
        *(
            (
                {"fields": {"rgb": [0]}, "field_reductions": {"rgb": reduction}},
                ConfigError,
                "reduction of rgb.*one of mean, first, last",
            )
            for reduction in ("max", "median", "variance")
        ),
        ({"fields": ["i"]}, ConfigError, "'fields': expected a mapping"),
        ({"fields": {"rgb": [[1], [1, 2]]}}, GeometryError, "field 'rgb': expected numbers"),
        (
            {"field_reductions": {"i": "max"}},
            ConfigError,
            "field_reductions: expected fields, .* got 'i'",
        ),
        ({"fields": {"": [1]}}, GridMapError, "non-empty string"),
    ],
)
def test_invalid_arguments_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        rasterize([[0, 0, 0]], GRID, **options)
    assert (GRID["elevation"] == 1).all()
    assert GRID.layers == ("elevation",)
