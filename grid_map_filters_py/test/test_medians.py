# SPDX-License-Identifier: BSD-3-Clause
"""Medians of windows, against a loop over cells."""

import filter_oracles as oracles
import numpy as np
import pytest

from grid_map_filters_py.parts._medians import put_window_medians


def medians_of(layer, cells, half_width):
    output = np.full(layer.shape, -99, np.float32, order="F")
    put_window_medians(output, layer, cells, half_width)
    return output


@pytest.mark.parametrize("share", [0.1, 0.6, 1.0])
@pytest.mark.parametrize("half_width", [0, 1, 2, 3, 5, 30])
@pytest.mark.parametrize("missing", [0.0, 0.2, 0.95, 1.0])
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (14, 11), (13, 6)], ids=str)
def test_medians_equal_a_loop_over_cells(size, missing, half_width, share):
    random = np.random.default_rng(sum(size) + half_width)
    # Only 18 different values, so that many are equal.
    layer = np.asfortranarray(random.integers(-9, 9, size).astype(np.float32))
    holes = random.random(size) < missing
    layer[holes] = random.choice([np.nan, np.inf, -np.inf], size)[holes]
    cells = np.asfortranarray(random.random(size) < share)
    medians = medians_of(layer, cells, half_width)
    for cell in np.ndindex(size):
        expected = -99.0
        if cells[cell]:
            expected = oracles.upper_median(oracles.in_square(layer, half_width, *cell))
        np.testing.assert_array_equal(medians[cell], expected)


def test_medians_do_not_depend_on_the_pieces():
    layer = np.random.default_rng(1).normal(size=(301, 257)).astype(np.float32, order="F")
    layer[::7, ::3] = np.nan
    everywhere = np.ones(layer.shape, dtype=bool, order="F")
    few = np.zeros_like(everywhere)
    few[5::40, 3::30] = True
    for half_width in (2, 6):
        medians = medians_of(layer, everywhere, half_width)
        np.testing.assert_array_equal(medians[few], medians_of(layer, few, half_width)[few])
