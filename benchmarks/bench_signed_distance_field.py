# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of the signed distance field: building it, and 100,000 queries.

The terrain has holes, as in the C++ timings. C++ treats holes as very deep; we treat them as free.
"""

import numpy as np
import pytest
from oracles import PROBES
from terrain import terrain

from grid_map_core_py.map import SignedDistanceField

CLEARANCE = 0.5
POINTS = 100_000


def build(grid_map):
    elevation = grid_map["elevation"]
    low, high = np.nanmin(elevation) - CLEARANCE, np.nanmax(elevation) + CLEARANCE
    return SignedDistanceField(grid_map, "elevation", low, high, unknown="free")


@pytest.fixture
def field(cells):
    return build(terrain(cells))


@pytest.fixture
def points(field):
    """Return random points (N, 3) throughout the field."""
    half = 0.5 * (field.geometry.length - field.resolution)
    low, high = (*-half, field.levels[0]), (*half, field.levels[-1])
    return np.random.default_rng(1).uniform(low, high, (POINTS, 3))


def exact(grid_map, cell, z):
    """Return the exact distance of a point at height z in a cell, searching all columns."""
    x, y = grid_map.axes()
    across = np.hypot(x[:, None] - x[cell[0]], y[None, :] - y[cell[1]])
    up = z - np.nan_to_num(grid_map["elevation"].astype(np.float64), nan=-np.inf)
    if up[cell] > 0:
        return np.hypot(across, np.maximum(up, 0)).min()
    return -np.hypot(across, np.maximum(-up, 0)).min()


def test_build(measure, cells):
    grid_map = terrain(cells)
    row = "SDF calculateSignedDistanceField clearance 0.5"
    field = measure(row, cells, lambda: build(grid_map))
    for cell in PROBES:
        expected = [exact(grid_map, cell, z) for z in field.levels]
        np.testing.assert_allclose(field.distances[cell], expected, rtol=1e-6, atol=1e-6)


def test_nearest_values(measure, cells, field, points):
    values = measure("SDF getDistanceAt x100k", cells, lambda: field.nearest_value(points))
    assert np.abs(values - field.value(points)).max() <= 2 * field.resolution


def test_values(measure, cells, field, points):
    row = "SDF getInterpolatedDistanceAt x100k"
    values = measure(row, cells, lambda: field.value(points))
    for number in range(0, POINTS, 9_973):
        value, _ = interpolated(field, points[number])
        np.testing.assert_allclose(values[number], value, rtol=1e-5, atol=1e-6)


def test_values_and_gradients(measure, cells, field, points):
    row = "SDF values and gradients x100k"
    values, gradients = measure(row, cells, lambda: field.value_and_gradient(points))
    for number in range(0, POINTS, 9_973):
        value, gradient = interpolated(field, points[number])
        np.testing.assert_allclose(values[number], value, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(gradients[number], gradient, atol=1e-4)


def interpolated(field, point):
    """Interpolate value and gradient at one point from the eight surrounding nodes."""
    x, y = field.geometry.axes_in_map_order()
    steps = field.resolution * np.array([-1, -1, 1])
    place = (point - (x[0], y[0], field.levels[0])) / steps
    i, j, k = np.floor(place).astype(int)
    corners = field.distances[i : i + 2, j : j + 2, k : k + 2].astype(np.float64)
    weights = [np.array([1 - part, part]) for part in place % 1]
    gradient = []
    for axis in range(3):
        slopes = [*weights[:axis], np.array([-1, 1]), *weights[axis + 1 :]]
        gradient.append(np.einsum("ijk,i,j,k", corners, *slopes) / steps[axis])
    return np.einsum("ijk,i,j,k", corners, *weights), np.array(gradient)
