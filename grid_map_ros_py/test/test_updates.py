# SPDX-License-Identifier: BSD-3-Clause
"""Updates of occupancy grids and costmaps."""

import copy
import math
from typing import Any

import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import CostRange
from grid_map_ros_py import (
    MessageError,
    apply_update,
    to_costmap,
    to_costmap_update,
    to_occupancy_grid,
    to_occupancy_grid_update,
)

pytestmark = pytest.mark.usefixtures("nav2")


def to_grid(grid_map: GridMap) -> Any:
    return to_occupancy_grid(grid_map, "cost", codec=CostRange())


def to_raw(grid_map: GridMap) -> Any:
    return to_costmap(grid_map, "cost")


KINDS = pytest.mark.parametrize(
    ("convert", "to_update"), [(to_grid, to_occupancy_grid_update), (to_raw, to_costmap_update)]
)


def costs(shape: tuple[int, int] = (7, 4), value: float = 9.0, **arguments: Any) -> GridMap:
    """Return a moved map with one cost."""
    arguments = {"frame_id": "map", "layers": {"cost": value}, **arguments}
    grid_map = GridMap(np.multiply(shape, 0.1), 0.1, **arguments)
    grid_map.move(grid_map.position + (0.3, -0.2))
    return grid_map


@KINDS
@pytest.mark.parametrize("shape", [(1, 1), (23, 17), (1, 5)])
def test_replayed_updates_equal_full_grids(convert, to_update, shape) -> None:
    grid_map, random = costs(shape), np.random.default_rng(2)
    grid = last = convert(grid_map)
    for number in range(200):
        begin = random.integers(0, grid_map.size)
        end = begin + random.integers(0, 6, 2)
        block = grid_map["cost"][begin[0] : end[0], begin[1] : end[1]]
        block[...] = random.choice([0, 1, 100, 253, 254, math.nan])
        grid_map.timestamp = number
        now, kept = convert(grid_map), copy.deepcopy(grid)
        update = to_update(last, now)
        different = np.reshape(np.not_equal(last.data, now.data), shape[::-1])
        assert (update is None) == (not different.any())
        if update is not None:
            rows, columns = np.nonzero(different)
            assert (update.x, update.y) == (columns.min(), rows.min())
            assert len(update.data) == (np.ptp(columns) + 1) * (np.ptp(rows) + 1)
            before, grid = grid, apply_update(grid, update)
            assert (before, grid.header) == (kept, now.header)
        assert grid.data == now.data
        last = now


@KINDS
@pytest.mark.parametrize(
    "other",
    [
        costs(position=(0.1, 0.0)),
        costs(frame_id="odom"),
        costs((4, 7)),
        GridMap((0.7, 0.4), 0.05, (0.3, -0.2), {"cost": 0.0}, frame_id="map"),
    ],
)
def test_update_between_different_grids_is_refused(convert, to_update, other: GridMap) -> None:
    with pytest.raises(MessageError, match="expected frame and grid of the first message"):
        to_update(convert(costs()), convert(other))


@KINDS
@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"x": 6}, "expected a rectangle within 7 x 4 cells"),
        ({"y": -1}, "expected a rectangle within 7 x 4 cells"),
        ({"data": b"0"}, "data: expected 8 values, got 1"),
        (
            {"header": to_grid(costs(frame_id="odom")).header},
            "frame_id: expected 'map', got 'odom'",
        ),
    ],
)
def test_wrong_update_is_refused(convert, to_update, change: dict[str, Any], text: str) -> None:
    grid = convert(costs())
    update = to_update(grid, convert(costs(value=254.0)))
    vars(update).update(change)
    with pytest.raises(MessageError, match=text):
        apply_update(grid, update)
