# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of a robot of 0.9 x 0.5 m on a moved map with cells of 0.1 m."""

import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.planning import Footprint, check_path, check_pose, footprint_layer
from grid_map_core_py.testing import moved_in_buffer
from grid_map_filters_py._builtin import Footprint as FootprintFilter

ROBOT = Footprint.rectangle(0.9, 0.5)
RULES = {"layer": "value", "limit": 0.5}
YAWS = 16


@pytest.fixture
def grid_map(cells):
    """Values of 0.5 and more, except in one cell of a hundred."""
    random = np.random.default_rng(0)
    values = np.where(random.random((cells, cells)) < 0.01, 0.0, 0.5 + random.random())
    grid_map = GridMap((0.1 * cells, 0.1 * cells), 0.1, layers={"value": values})
    return moved_in_buffer(grid_map, (cells // 3, cells // 5))


def test_check_pose(measure, cells, grid_map):
    pose = (3.0, -2.0, 0.4)
    found = measure("check_pose", cells, lambda: check_pose(grid_map, ROBOT, pose, **RULES))
    assert found.unknown == 0
    assert found.is_free == (found.worst >= 0.5)


def test_check_path(measure, cells, grid_map):
    """100 poses along a circle of 4 m."""
    grid_map["value"] = 1.0
    angles = np.linspace(0.0, 2.0 * np.pi, 100)
    poses = np.stack([4 * np.cos(angles), 4 * np.sin(angles), angles + np.pi / 2], axis=1)
    row = "check_path of 100 poses"
    found = measure(row, cells, lambda: check_path(grid_map, ROBOT, poses, **RULES))
    assert found.is_free
    assert (found.worst, found.unknown) == (1.0, 0.0)


@pytest.mark.parametrize("statistic", ["min", "mean"])
def test_footprint_layer(measure, cells, grid_map, statistic):
    row = f"footprint_layer {statistic} {YAWS} yaws"
    found = measure(row, cells, lambda: footprint_layer(grid_map, ROBOT, "value", YAWS, statistic))
    for row, column, number in ((20, 30, 0), (100, 90, 3), (55, 150, 13)):
        pose = (*grid_map.get_position((row, column)), 2 * np.pi * number / YAWS)
        under = check_pose(grid_map, ROBOT, pose, **RULES)
        expected = under.worst if statistic == "min" else under.mean
        np.testing.assert_allclose(found[row, column, number], expected, rtol=1e-6)


def test_footprint_filter(measure, cells, grid_map):
    outline = tuple(map(tuple, ROBOT.points.tolist()))
    worst = FootprintFilter(input_layer="value", output_layer="out", footprint=outline)
    found = measure("Footprint 16 yaws", cells, lambda: worst(grid_map))["out"]
    np.testing.assert_array_equal(
        found, footprint_layer(grid_map, ROBOT, "value", YAWS).min(axis=2)
    )
