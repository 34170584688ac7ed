# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Points in voxels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from grid_map_core_py import GeometryError
from grid_map_core_py.conversions import downsample
from grid_map_core_py.conversions._point_cloud_pipeline import finite_points

SIDES = st.sampled_from([0.25, 0.5, 1.0, 3.0])
NUMBERS = st.floats(-4, 4, width=32) | st.sampled_from([np.nan, np.inf])


def downsample_by_hand(points, sides) -> np.ndarray:
    """Oracle: sort points into a list per voxel one by one."""
    voxels = {}
    for point in points:
        if np.isfinite(point).all():
            voxels.setdefault(tuple(np.floor(point / sides)), []).append(point)
    return np.array([np.mean(voxels[key], axis=0) for key in sorted(voxels)]).reshape(-1, 3)


@given(
    arrays.arrays(np.float64, st.tuples(st.integers(0, 40), st.just(3)), elements=NUMBERS),
    st.tuples(SIDES, SIDES, SIDES),
)
def test_voxels_hold_the_mean_of_their_points(points, sides):
    result = downsample(points, sides)
    np.testing.assert_allclose(result, downsample_by_hand(points, sides), atol=1e-12)


def test_large_coordinates_keep_precision():
    points = np.array([(5e6, 5e6, 0), (5e6 + 0.001, 5e6, 0), (5e6 + 10, 5e6, 0)])
    result = downsample(points, (1, 1, 1))
    np.testing.assert_allclose(result[:, 0] - 5e6, (0.0005, 10), atol=2e-9)


@pytest.mark.parametrize("size", [(1, 1), (1, 1, 0), (1, -1, 1), (1, np.nan, 1), 1.0])
def test_a_voxel_needs_three_positive_sides(size):
    with pytest.raises(GeometryError, match="voxel_size: expected three positive numbers"):
        downsample([(0, 0, 0)], size)


def test_the_sides_of_a_voxel_are_numbers():
    with pytest.raises(GeometryError, match="voxel_size: expected numbers, got 'small'"):
        downsample([(0, 0, 0)], "small")


def test_voxels_too_small_to_be_counted_are_refused():
    with pytest.raises(GeometryError, match=r"expected fewer than 2\*\*62 voxels"):
        downsample([(0, 0, 0), (1e9, 1e9, 1e9)], (1e-3, 1e-3, 1e-3))


def test_finite_points_are_their_own_copy():
    points = np.array([(0.0, 1, 2), (np.nan, 0, 0), (0, 0, -np.inf)])
    result = finite_points(points)
    result[...] = 7
    assert result.shape == (1, 3)
    assert points[0, 1] == 1
