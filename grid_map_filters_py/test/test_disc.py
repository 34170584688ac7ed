# SPDX-License-Identifier: BSD-3-Clause
"""Discs, and sums over discs, against loops over neighbors."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from grid_map_core_py import GridMap
from grid_map_filters_py._builtin import MeanInRadius
from grid_map_filters_py.parts import Disc, typical_value

RESOLUTION = 0.1


def offsets_in_disc(radius: float, size: tuple[int, int]) -> list[tuple[int, int]]:
    """Return row and column offsets to the cells of a disc, at most the size of the map."""
    rows, columns = (np.arange(1 - length, length) for length in size)
    return [
        (int(row), int(column))
        for row in rows
        for column in columns
        if RESOLUTION * np.hypot(row, column) <= radius + 1e-9
    ]


def sums_over(values, offsets):
    """Return for every cell the sum of the values at an offset, inside the map."""
    rows, columns = values.shape
    padded = np.pad(values, [(rows, rows), (columns, columns)])
    return sum(padded[rows + i : 2 * rows + i, columns + j : 2 * columns + j] for i, j in offsets)


radii = st.sampled_from([0.0, 0.09, 0.1, 0.15, 0.2, 0.35, 0.5, 1.2, 1e6])
sizes = st.tuples(st.integers(1, 9), st.integers(1, 9))


@given(radius=radii, size=sizes, seed=st.integers(0, 99))
@settings(max_examples=100)
def test_sums_and_counts_equal_those_over_neighbors(radius, size, seed):
    random = np.random.default_rng(seed)
    layer = np.asfortranarray(random.integers(-9, 9, size), dtype=np.float32)
    layer[random.random(size) < 0.3] = random.choice([np.nan, np.inf])
    known = np.isfinite(layer)
    offsets, disc = offsets_in_disc(radius, size), Disc(radius, RESOLUTION, size)
    is_finite, values = disc.padded(layer, 1.0)
    np.testing.assert_array_equal(disc.counts(is_finite), sums_over(known.astype(int), offsets))
    differences = np.where(known, layer - 1.0, 0.0)
    np.testing.assert_array_equal(disc.sums(values), sums_over(differences, offsets))


@given(radius=radii, size=sizes)
@settings(max_examples=50)
def test_kernel_has_the_cells_of_the_disc(radius, size):
    disc = Disc(radius, RESOLUTION, size)
    cells = np.argwhere(disc.kernel) - disc.reach
    assert sorted(map(tuple, cells.tolist())) == sorted(offsets_in_disc(radius, size))


@pytest.mark.parametrize("radius", [0.0, 0.1, 0.3, 0.7])
@pytest.mark.parametrize("value", [3e38, -3e38, 1e-40])
def test_mean_of_equal_values_is_exact_for_huge_values(radius, value):
    grid_map = GridMap((2.0, 1.0), RESOLUTION, layers={"z": value})
    grid_map["z"][3, 4] = np.inf
    mean = MeanInRadius(input_layer="z", output_layer="mean", radius=radius)(grid_map)["mean"]
    expected = np.full(mean.shape, value, np.float32)
    expected[3, 4] = np.nan if radius == 0.0 else value
    np.testing.assert_allclose(mean, expected, rtol=1e-6)


def test_typical_value_is_finite_and_near_the_median():
    random = np.random.default_rng(2)
    layer = np.asfortranarray(1000 + random.normal(size=(300, 200)), dtype=np.float32)
    layer[random.random(layer.shape) < 0.2] = np.nan
    layer[7, 7] = 1e38
    assert typical_value(layer) == pytest.approx(1000, abs=1)
    alone = np.full((300, 200), np.nan, np.float32, order="F")
    alone[123, 45] = 7.0
    assert typical_value(alone) == 7.0
    assert typical_value(np.full((2, 2), np.inf, np.float32)) == 0.0
    assert typical_value(np.full((2, 2), 3e38, np.float32)) == np.float32(3e38)
