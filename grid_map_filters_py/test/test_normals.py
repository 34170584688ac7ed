# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Normals in tiles, against loops over cells."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grid_map_filters_py._shared.normals import area_normals, raster_normals

RESOLUTION = 0.1


def hills(rows: int, columns: int, holes: float = 0.1) -> np.ndarray:
    random = np.random.default_rng(3)
    layer = np.add.outer(np.sin(np.arange(rows) / 9), np.cos(np.arange(columns) / 7))
    layer += 0.05 * random.normal(size=layer.shape)
    layer[random.random(layer.shape) < holes] = np.nan
    return np.asfortranarray(layer, dtype=np.float32)


def points_around(layer, row, column, radius):
    """Return the finite points (N, 3) of the closed disc around a cell."""
    points = [
        (-RESOLUTION * (i - row), -RESOLUTION * (j - column), layer[i, j])
        for i, j in np.ndindex(layer.shape)
        if RESOLUTION * np.hypot(i - row, j - column) <= radius + 1e-9
    ]
    points = np.array(points, dtype=np.float64)
    return points[np.isfinite(points).all(axis=1)]


def best_normal(points):
    """Return the upward normal of the least-squares plane, and the variances in ascending order."""
    if len(points) < 3:
        return np.array([0, 0, 1]), np.zeros(3)
    values, vectors = np.linalg.eigh(np.cov(points.T, bias=True))
    normal = vectors[:, 0] if values[1] > 1e-8 else np.array([0, 0, 1])
    return normal * np.copysign(1.0, normal[2]), values


def normal_at(normals, row, column):
    return np.array([component[row, column] for component in normals])


@pytest.mark.parametrize("shape", [(300, 5), (5, 300), (271, 140)])
@pytest.mark.parametrize("radius", [0.1, 0.25, 1.3])
def test_tiles_have_no_seams(shape, radius):
    layer = hills(*shape)
    normals = area_normals(layer, radius, RESOLUTION)
    for component in normals:
        np.testing.assert_array_equal(np.isnan(component), np.isnan(layer))
    places = np.arange(0, max(shape), 13)
    for row, column in zip(places % shape[0], places % shape[1], strict=True):
        if np.isfinite(layer[row, column]):
            reach = int(radius / RESOLUTION) + 1
            rows = slice(max(row - reach, 0), row + reach + 1)
            columns = slice(max(column - reach, 0), column + reach + 1)
            points = points_around(
                layer[rows, columns], row - rows.start, column - columns.start, radius
            )
            expected, _ = best_normal(points)
            np.testing.assert_allclose(normal_at(normals, row, column), expected, atol=1e-5)


@pytest.mark.parametrize("radius", [29.0, 1e6, 1e200])
def test_disc_may_be_larger_than_tile_and_map(radius):
    layer = hills(300, 4, holes=0.0)
    expected, _ = best_normal(points_around(layer, 150, 2, min(radius, 1e3)))
    normal = normal_at(area_normals(layer, radius, RESOLUTION), 150, 2)
    np.testing.assert_allclose(normal, expected, atol=1e-5)


@given(
    heights=st.lists(st.floats(-1, 1, width=32), min_size=25, max_size=25),
    magnitude=st.integers(-6, 7),
    holes=st.sets(st.integers(0, 24), max_size=20),
)
@settings(max_examples=300)
def test_normals_have_the_direction_of_least_variance(heights, magnitude, holes):
    layer = 10.0**magnitude * np.array(heights)
    layer[list(holes - {12})] = np.nan
    layer = np.asfortranarray(layer.reshape(5, 5), dtype=np.float32)
    normal = normal_at(area_normals(layer, 0.25, RESOLUTION), 2, 2)
    assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-6)
    assert normal[2] >= 0
    points = points_around(layer, 2, 2, 0.25)
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
    layer = np.full((3, 3), np.nan, np.float32, order="F")
    layer[0, 1], layer[1, 1] = 0.3, 0.2
    assert normal_at(area_normals(layer, 0.15, RESOLUTION), 1, 1).tolist() == [0, 0, 1]
    layer[1, 0] = 0.2
    # z rises by 1 along x and is constant along y.
    tilted = np.array([-1, 0, 1]) / np.sqrt(2)
    normal = normal_at(area_normals(layer, 0.15, RESOLUTION), 1, 1)
    np.testing.assert_allclose(normal, tilted, atol=1e-6)


@pytest.mark.parametrize(("resolution", "tilted"), [(2e-5, False), (2e-3, True)])
def test_points_within_0_1_mm_define_no_plane(resolution, tilted):
    heights = resolution * np.add.outer(np.arange(7.0), np.zeros(7))
    layer = np.asfortranarray(heights, dtype=np.float32)
    _, _, z = area_normals(layer, 2 * resolution, resolution)
    np.testing.assert_allclose(z, np.sqrt(0.5) if tilted else 1.0, atol=1e-5)


def slope_along(ahead, center, behind):
    """Return the slope: central, else one-sided, else NaN."""
    if np.isfinite([ahead, behind]).all():
        return (ahead - behind) / (2 * RESOLUTION)
    one_sided = (ahead - center) if np.isfinite(ahead) else (center - behind)
    return one_sided / RESOLUTION if np.isfinite(one_sided) else np.nan


@pytest.mark.parametrize("shape", [(1, 1), (2, 9), (3, 3), (270, 7), (9, 140)])
def test_raster_normals_follow_slopes_between_neighbors(shape):
    layer = hills(*shape, holes=0.3)
    layer[shape[0] // 2, shape[1] // 3] = np.inf
    normals = raster_normals(layer, RESOLUTION)
    expected = np.full((3, *shape), np.nan)
    z = layer.astype(np.float64)
    for row in range(1, shape[0] - 1):
        for column in range(1, shape[1] - 1):
            # Rows run towards -x, columns towards -y.
            x = slope_along(z[row - 1, column], z[row, column], z[row + 1, column])
            y = slope_along(z[row, column - 1], z[row, column], z[row, column + 1])
            expected[:, row, column] = np.array([-x, -y, 1.0]) / np.sqrt(x * x + y * y + 1.0)
    np.testing.assert_allclose(np.stack(normals), expected, atol=1e-6)
