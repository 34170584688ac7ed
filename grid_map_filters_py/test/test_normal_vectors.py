# SPDX-License-Identifier: BSD-3-Clause
"""The filter `NormalVectors`, against loops over cells and known surfaces."""

import numpy as np
import pytest
from filter_cases import CELLS_OF_PLANES, ground, points_in_disc, run, terrain
from hypothesis import given, settings, strategies as st

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


def hills(rows: int, columns: int, holes: float = 0.1) -> np.ndarray:
    random = np.random.default_rng(3)
    layer = np.add.outer(np.sin(np.arange(rows) / 9), np.cos(np.arange(columns) / 7))
    layer += 0.05 * random.normal(size=layer.shape)
    layer[random.random(layer.shape) < holes] = np.nan
    return np.asfortranarray(layer, dtype=np.float32)


def best_normal(points):
    """Return the upward normal of the least-squares plane, and the variances in ascending order."""
    if len(points) < 3:
        return np.array([0, 0, 1]), np.zeros(3)
    values, vectors = np.linalg.eigh(np.cov(points.T, bias=True))
    normal = vectors[:, 0] if values[1] > 1e-8 else np.array([0, 0, 1])
    return normal * np.copysign(1.0, normal[2]), values


@given(grid_maps(allow_moved=False), CELLS_OF_PLANES)
@settings(max_examples=40)
def test_area_normals_equal_least_squares_planes(grid_map, cells):
    radius = cells * grid_map.resolution
    result = normals(grid_map, radius=radius)
    np.testing.assert_array_equal(
        np.isnan(result).all(axis=-1), ~np.isfinite(grid_map["elevation"])
    )
    for index in np.argwhere(np.isfinite(grid_map["elevation"])):
        normal, points = result[tuple(index)], points_in_disc(grid_map, index, radius)
        expected, values = best_normal(points)
        if values[1] <= 1e-8:
            assert normal.tolist() == [0, 0, 1]
        # The gap between the two smallest eigenvalues limits the precision of the direction.
        elif values[1] - values[0] > 1e-2 * values[2]:
            assert abs(normal @ expected) == pytest.approx(1.0, abs=1e-4)


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


def test_normals_point_along_the_positive_axis():
    grid_map = terrain((9, 9))
    x, y = grid_map.get_positions().T
    grid_map["elevation"] = np.sin(9 * x + 4 * y).reshape(grid_map.size, order="F")
    for number, axis in enumerate("xyz"):
        for params in ({"radius": 0.15}, {"algorithm": "raster"}):
            result = normals(grid_map, normal_vector_positive_axis=axis, **params)
            assert np.nanmin(result[..., number]) >= 0


# --- tiles, and the plane of least squares --------------------------------------------------------


@pytest.mark.parametrize("radius", [29.0, 1e6, 1e200])
def test_disc_may_be_larger_than_tile_and_map(radius):
    grid_map = ground(hills(300, 4, holes=0.0))
    expected, _ = best_normal(points_in_disc(grid_map, (150, 2), min(radius, 1e3)))
    np.testing.assert_allclose(normals(grid_map, radius=radius)[150, 2], expected, atol=1e-5)


@given(
    heights=st.lists(st.floats(-1, 1, width=32), min_size=25, max_size=25),
    magnitude=st.integers(-6, 7),
    holes=st.sets(st.integers(0, 24), max_size=20),
)
@settings(max_examples=300)
def test_normals_have_the_direction_of_least_variance(heights, magnitude, holes):
    layer = 10.0**magnitude * np.array(heights)
    layer[list(holes - {12})] = np.nan
    grid_map = ground(layer.reshape(5, 5))
    normal = normals(grid_map, radius=0.25)[2, 2]
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-6)
    assert normal[2] >= 0
    points = points_in_disc(grid_map, (2, 2), 0.25)
    expected, variances = best_normal(points)
    if variances[1] < 0.9e-8:
        assert normal.tolist() == [0, 0, 1]
    elif variances[1] > 1.1e-8:
        spread = normal @ np.cov(points.T, bias=True) @ normal
        # The error of float32 components grows with the spread of the heights.
        assert spread <= variances[0] + 1e-6 * variances[1] + 1e-13 * variances[2]
        if variances[1] - variances[0] > 1e-3 * variances[2]:
            assert abs(normal @ expected) == pytest.approx(1.0, abs=1e-6)


def test_three_points_define_a_plane_and_two_do_not():
    layer = np.full((3, 3), np.nan)
    layer[0, 1], layer[1, 1] = 0.3, 0.2
    assert normals(ground(layer), radius=0.15)[1, 1].tolist() == [0, 0, 1]
    layer[1, 0] = 0.2
    # z rises by 1 along x and is constant along y.
    tilted = np.array([-1, 0, 1]) / np.sqrt(2)
    np.testing.assert_allclose(normals(ground(layer), radius=0.15)[1, 1], tilted, atol=1e-6)


def slope_along(ahead, center, behind):
    """Return the slope: central, else one-sided, else NaN."""
    if np.isfinite([ahead, behind]).all():
        return (ahead - behind) / (2 * 0.1)
    one_sided = (ahead - center) if np.isfinite(ahead) else (center - behind)
    return one_sided / 0.1 if np.isfinite(one_sided) else np.nan


@pytest.mark.parametrize("shape", [(1, 1), (2, 9), (3, 3), (270, 7), (9, 140)])
def test_raster_normals_follow_slopes_between_neighbors(shape):
    layer = hills(*shape, holes=0.3)
    layer[shape[0] // 2, shape[1] // 3] = np.inf
    expected = np.full((*shape, 3), np.nan)
    z = layer.astype(np.float64)
    for row in range(1, shape[0] - 1):
        for column in range(1, shape[1] - 1):
            # Rows run towards -x, columns towards -y.
            x = slope_along(z[row - 1, column], z[row, column], z[row + 1, column])
            y = slope_along(z[row, column - 1], z[row, column], z[row, column + 1])
            expected[row, column] = np.array([-x, -y, 1.0]) / np.sqrt(x * x + y * y + 1.0)
    result = normals(ground(layer), algorithm="raster")
    np.testing.assert_allclose(result, expected, atol=1e-6)
