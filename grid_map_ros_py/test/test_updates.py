# SPDX-License-Identifier: BSD-3-Clause
"""Updates of occupancy grids and costmaps."""

import copy
import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from test_costs import costs

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


to_grid = partial(to_occupancy_grid, layer="cost", codec=CostRange())
to_raw = partial(to_costmap, layer="cost")
KINDS = pytest.mark.parametrize(
    ("convert", "to_update"), [(to_grid, to_occupancy_grid_update), (to_raw, to_costmap_update)]
)


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
            field = "info" if hasattr(grid, "info") else "metadata"
            assert getattr(grid, field) is not getattr(before, field)
            assert grid.header is not update.header
        assert grid.data == now.data
        last = now


@KINDS
@pytest.mark.parametrize(
    "other",
    [costs((7, 4), shift=0.4), costs((7, 4), frame_id="map"), costs((4, 7)), costs((7, 4), 0.05)],
)
def test_update_between_different_grids_is_refused(convert, to_update, other: GridMap) -> None:
    with pytest.raises(MessageError, match="expected frame and grid of the first message"):
        to_update(convert(costs((7, 4))), convert(other))


@KINDS
@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"x": 6}, "expected a rectangle within 7 x 4 cells"),
        ({"y": -1}, "expected a rectangle within 7 x 4 cells"),
        ({"data": b"0"}, "data: expected 28 values, got 1"),
        (
            {"header": to_grid(costs((1, 1), frame_id="map")).header},
            "frame_id: expected 'odom', got 'map'",
        ),
    ],
)
def test_wrong_update_is_refused(convert, to_update, change: dict[str, Any], text: str) -> None:
    grid = convert(costs((7, 4)))
    update = to_update(grid, convert(costs((7, 4)).with_layers({"cost": np.full((7, 4), 254.0)})))
    vars(update).update(change)
    with pytest.raises(MessageError, match=text):
        apply_update(grid, update)
