# SPDX-License-Identifier: BSD-3-Clause
"""The filter `StepHeight`, against loops over cells."""

from functools import partial

import numpy as np
import pytest
from filter_cases import CELLS, assert_cells_are, filtered, ground, points_in_disc
from hypothesis import given, settings, strategies as st

from grid_map_core_py import circle_cells
from grid_map_core_py.testing import grid_maps

step_height = partial(filtered, "gridMapFilters/StepHeightFilter")


def step_in_disc(grid_map, index, radius):
    heights = points_in_disc(grid_map, index, radius)[:, 2]
    return np.ptp(heights) if np.isfinite(grid_map["elevation"][index]) else np.nan


@given(grid_maps(allow_moved=False), CELLS)
@settings(max_examples=40)
def test_step_height_is_the_largest_difference_in_the_disc(grid_map, cells):
    radius = cells * grid_map.resolution
    result = step_height(grid_map, radius=radius)
    assert_cells_are(result, lambda index: step_in_disc(grid_map, index, radius), rtol=1e-6)


@given(grid_maps(allow_moved=False), CELLS, CELLS, st.integers(1, 8), st.floats(0, 1000, width=16))
@settings(max_examples=40)
def test_second_window_weighs_steps_by_number_of_cells(grid_map, first, second, number, critical):
    first, second = first * grid_map.resolution, second * grid_map.resolution
    params = {"radius": first, "second_window_radius": second}
    result = step_height(grid_map, **params, critical_value=critical, critical_cell_number=number)
    steps = step_height(grid_map, radius=first)

    def weighed(index):
        cells = circle_cells(grid_map, grid_map.get_position(index), second)
        around = steps[cells]
        around = around[np.isfinite(around)].astype(np.float64)
        if not around.size:
            return np.nan
        return min(1.0, np.sum(around > critical) / number) * around.max()

    assert_cells_are(result, weighed, rtol=1e-6)


def test_spikes_are_no_steps_but_curbs_are():
    spike, curb = np.zeros((11, 11)), np.zeros((11, 11))
    spike[5, 5] = curb[5:] = 0.2
    params = {"radius": 0.1, "second_window_radius": 0.1, "critical_value": 0.15}
    # Five discs contain the spike; in every column, the discs of two cells contain the curb.
    for heights, number, expected in [(spike, 10, 0.1), (spike, 5, 0.2), (curb, 4, 0.2)]:
        result = step_height(ground(heights), critical_cell_number=number, **params)
        assert result.max() == pytest.approx(expected)
        assert result[0, 0] == 0
