# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of the steps of the `costmap` node: full messages, updates and other frames."""

import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import CostRange
from grid_map_ros_py import (
    ReceivedMap,
    apply_update,
    to_costmap,
    to_costmap_update,
    to_occupancy_grid,
    to_occupancy_grid_update,
    to_serialized_message,
)
from grid_map_ros_py._costs import check_costs, resampled

STAND_INS = Path(__file__).resolve().parents[1] / "grid_map_ros_py" / "test"


@pytest.fixture(autouse=True)
def nav2(monkeypatch):
    """Replace the optional messages for Nav2 by stand-ins."""
    monkeypatch.syspath_prepend(STAND_INS)
    for package in ("map_msgs", "nav2_msgs"):
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", __import__("nav2_stand_in"))


def costs(cells):
    """Return a moved map with random costs and 5 % unknown cells."""
    grid_map = GridMap((0.05 * cells, 0.05 * cells), 0.05, layers={"cost": 0.0}, frame_id="odom")
    grid_map.move((0.5, 0.35))
    random = np.random.default_rng(1)
    grid_map["cost"] = random.integers(0, 255, grid_map.size)
    grid_map["cost"][random.random(grid_map.size) < 0.05] = np.nan
    return grid_map


def to_messages(grid_map):
    return to_occupancy_grid(grid_map, "cost", codec=CostRange()), to_costmap(grid_map, "cost")


def test_full_messages(measure, cells):
    grid_map = costs(cells)
    data = to_serialized_message(grid_map)

    def convert():
        received = ReceivedMap(data).decode(["cost"], copy=False)
        check_costs(received, "cost")
        return to_messages(received)

    grid, raw = measure("costmap, full messages", cells, convert)
    values = np.reshape(raw.data, grid_map.size)[::-1, ::-1].T
    expected = np.nan_to_num(grid_map.unwrapped("cost"), nan=255)
    np.testing.assert_array_equal(values, expected)
    assert set(np.array(grid.data)[np.array(raw.data) == 253]) == {99}


def test_updates_of_30_x_30_cells(measure, cells):
    grid_map = costs(cells)
    grid, raw = to_messages(grid_map)
    grid_map["cost"][40:70, 50:80] = 254.0
    new_grid, new_raw = to_messages(grid_map)

    def update():
        return to_occupancy_grid_update(grid, new_grid), to_costmap_update(raw, new_raw)

    grid_update, raw_update = measure("costmap, updates of 30 x 30 cells", cells, update)
    assert apply_update(grid, grid_update).data == new_grid.data
    assert apply_update(raw, raw_update).data == new_raw.data


def test_rotated_frame(measure, cells):
    grid_map = costs(cells)
    transform = (1.0, -2.0, 0.5)
    turn = lambda: resampled(grid_map, "cost", transform, "map", 0.05)  # noqa: E731
    result = measure("costmap, rotated frame", cells, turn)
    assert np.nanmax(result["cost"]) == 254
    assert np.isfinite(result["cost"]).sum() > 0.5 * cells**2


def test_cells_of_10_m(measure, cells):
    grid_map = costs(cells)
    coarsen = lambda: resampled(grid_map, "cost", (1.0, -2.0, 0.5), "map", 10.0, 0)  # noqa: E731
    result = measure("costmap, cells of 10 m", cells, coarsen)
    assert np.nanmax(result["cost"]) == 254


def test_map_beside_the_grid(measure, cells):
    grid_map = costs(cells)
    grid_map.position = grid_map.position + 0.025
    shift = lambda: resampled(grid_map, "cost", (0.0, 0.0, 0.0), "odom", 0.05)  # noqa: E731
    result = measure("costmap, shifted by half a cell", cells, shift)
    assert result.size == (cells + 1, cells + 1)
