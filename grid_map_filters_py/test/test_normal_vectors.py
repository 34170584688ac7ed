# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The filter `NormalVectors`, against loops over cells and known surfaces."""

import numpy as np
import pytest
from filter_cases import CELLS_OF_PLANES, ground, points_in_disc, run, terrain
from hypothesis import given, settings
from hypothesis import strategies as st

from grid_map_core_py.testing import grid_maps


def normals(grid_map, **params):
    """Return the normals (rows, columns, 3), upward by default."""
    params = {
        "input_layer": "elevation",
        "output_layers_prefix": "normal_",
        "normal_vector_positive_axis": "z",
        **params,
    }
    result = run("gridMapFilters/NormalVectorsFilter", grid_map, **params)
    return np.stack([result["normal_" + axis] for axis in "xyz"], axis=-1)


@given(grid_maps(allow_moved=False), CELLS_OF_PLANES)
@settings(max_examples=40)
def test_area_normals_equal_least_squares_planes(grid_map, cells):
    radius = cells * grid_map.resolution
    result = normals(grid_map, radius=radius)
    for index in np.ndindex(grid_map.size):
        normal, points = result[index], points_in_disc(grid_map, index, radius)
        if not np.isfinite(grid_map["elevation"][index]):
            assert np.isnan(normal).all()
            continue
        np.testing.assert_allclose(np.linalg.norm(normal), 1.0, rtol=1e-5)
        values, vectors = (
            np.linalg.eigh(np.cov(points.T, bias=True)) if len(points) >= 3 else (np.zeros(3), None)
        )
        if values[1] <= 1e-8:
            assert normal.tolist() == [0, 0, 1]
            continue
        assert normal[2] >= 0
        # The gap between the two smallest eigenvalues limits the precision of the direction.
        variance = normal @ np.cov(points.T, bias=True) @ normal
        assert variance <= values[0] + 1e-5 * values[2]
        if values[1] - values[0] > 1e-2 * values[2]:
            assert abs(normal @ vectors[:, 0]) == pytest.approx(1.0, abs=1e-4)


@pytest.mark.parametrize("params", [{"radius": 0.25}, {"algorithm": "raster"}, {}])
@given(slope=st.tuples(st.floats(-3, 3), st.floats(-3, 3)), height=st.floats(-2000, 2000))
@settings(max_examples=20)
def test_normals_of_a_plane_are_its_normal(params, slope, height):
    grid_map = terrain((9, 7))
    x, y = grid_map.get_positions().T
    z = (slope[0] * x + slope[1] * y).reshape(grid_map.size, order="F")
    grid_map["elevation"] = z + height
    expected = np.array([-slope[0], -slope[1], 1.0]) / np.linalg.norm([*slope, 1.0])
    result = normals(grid_map, **params)[2:-2, 2:-2]
    # At 2000 m, float32 heights are exact to 0.1 mm; the cells span 0.2 m.
    np.testing.assert_allclose(result, np.broadcast_to(expected, result.shape), atol=2e-3)


def test_normals_keep_small_differences_on_high_ground():
    """The variance of the heights is 1e-11 of their square."""
    grid_map = terrain((30, 20))
    x, _ = grid_map.axes()
    slope = np.round(x / 8, 3)[:, None] * np.ones(20)
    grid_map["elevation"] = np.float32(4096) + slope
    plain = ground(grid_map["elevation"] - np.float32(4096))
    np.testing.assert_allclose(
        normals(grid_map, radius=0.35), normals(plain, radius=0.35), atol=1e-6
    )


def test_spike_has_unit_normal_in_plane_of_least_spread():
    heights = np.zeros((5, 5), dtype=np.float32)
    heights[2, 2] = 50.0
    normal = normals(ground(heights), radius=0.1)[2, 2]
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    assert normal[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("spread", [0.5e-8, 2e-8])
def test_points_on_a_line_define_no_plane(spread):
    """Two rows of points: the variance across them is a quarter of the resolution squared."""
    resolution = 2 * np.sqrt(spread)
    heights = np.tile(resolution * np.arange(40.0)[None, :], (2, 1))
    grid_map = ground(heights, resolution)
    middle = normals(grid_map, radius=resolution * 20)[0, 20]
    upright = middle.tolist() == [0, 0, 1]
    assert upright == (spread < 1e-8)


def test_mirrored_points_have_exactly_horizontal_normal():
    """Their plane is that of the mirror; the formula alone would give rounding errors."""
    heights = [[np.nan, 1.0], [0.5, -3.0], [-3.0, 1.0], [1.0, 0.5]]
    grid_map = ground(heights, 1.0)
    expected = np.linalg.eigh(np.cov(points_in_disc(grid_map, (2, 0), 2.0).T))[1][:, 0]
    assert abs(expected[2]) < 1e-9
    normal = normals(grid_map, radius=2.0)[2, 0]
    np.testing.assert_allclose(np.abs(normal), np.abs(expected), atol=1e-6)


def test_a_wall_has_a_horizontal_normal():
    heights = np.where(np.arange(9)[:, None] < 4, 1e4, 0.0) * np.ones(9)
    normal = normals(ground(heights), radius=0.15)[4, 4]
    np.testing.assert_allclose(np.abs(normal), [1, 0, 0], atol=1e-3)


def test_normals_point_along_the_positive_axis():
    grid_map = terrain((9, 9))
    x, y = grid_map.get_positions().T
    grid_map["elevation"] = np.sin(9 * x + 4 * y).reshape(grid_map.size, order="F")
    for number, axis in enumerate("xyz"):
        for params in ({"radius": 0.15}, {"algorithm": "raster"}):
            result = normals(grid_map, normal_vector_positive_axis=axis, **params)
            assert np.nanmin(result[..., number]) >= 0


def test_raster_normals_are_one_sided_at_holes():
    heights = np.tile(np.arange(6, dtype=np.float32)[:, None] * 0.1, (1, 5))
    heights[2, 2] = np.nan
    result = normals(ground(heights), algorithm="raster")
    assert np.isnan(result[0]).all()
    assert np.isnan(result[:, -1]).all()
    expected = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
    for index in [(1, 2), (3, 2), (1, 1), (4, 3)]:
        np.testing.assert_allclose(result[index], expected, atol=1e-6)
