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
    ("convert", "to_update", "sides"),
    [
        (to_grid, to_occupancy_grid_update, ("width", "height")),
        (to_raw, to_costmap_update, ("size_x", "size_y")),
    ],
)


def costs(shape: tuple[int, int] = (7, 4), seed: int = 1) -> GridMap:
    """Return a moved map with random costs, some of them unknown."""
    grid_map = GridMap(np.multiply(shape, 0.1), 0.1, layers={"cost": 0.0}, frame_id="map")
    grid_map.move((0.3, -0.2))
    random = np.random.default_rng(seed)
    grid_map["cost"] = random.integers(0, 255, shape)
    grid_map["cost"][random.random(shape) < 0.2] = np.nan
    return grid_map


@KINDS
def test_replayed_updates_equal_full_grids(convert, to_update, sides) -> None:
    grid_map, random = costs((23, 17)), np.random.default_rng(2)
    grid = last = convert(grid_map)
    count = 0
    for number in range(200):
        begin = random.integers(0, grid_map.size)
        end = begin + random.integers(0, 6, 2)
        block = grid_map["cost"][begin[0] : end[0], begin[1] : end[1]]
        block[...] = random.choice([0, 1, 100, 253, 254, math.nan])
        grid_map.timestamp = number
        now = convert(grid_map)
        update = to_update(last, now)
        before, after = (
            np.reshape(one.data, grid_map.size[::-1]).astype(int) for one in (last, now)
        )
        if update is None:
            np.testing.assert_array_equal(before, after)
        else:
            rows, columns = np.nonzero(before != after)
            size = np.ptp(columns) + 1, np.ptp(rows) + 1
            assert (update.x, update.y) == (columns.min(), rows.min())
            assert tuple(getattr(update, side) for side in sides) == size
            grid = apply_update(grid, update)
            assert grid.header == now.header
            count += 1
        assert grid.data == now.data
        last = now
    assert count > 100


@KINDS
@pytest.mark.parametrize("shape", [(1, 1), (1, 5)])
def test_equal_grids_need_no_update(convert, to_update, sides, shape) -> None:  # noqa: ARG001
    first, second = convert(costs(shape)), convert(costs(shape))
    kept = copy.deepcopy(first)
    assert to_update(first, second) is None
    changed = costs(shape)
    changed["cost"] = np.where(np.isnan(changed["cost"]), 7.0, np.nan)
    assert apply_update(first, to_update(first, convert(changed))).data == convert(changed).data
    assert first == kept


@KINDS
def test_update_between_different_grids_is_refused(convert, to_update, sides) -> None:  # noqa: ARG001
    moved, other_frame = costs(), costs()
    moved.move((0.4, -0.2))
    other_frame.frame_id = "odom"
    finer = GridMap((0.35, 0.2), 0.05, layers={"cost": 0.0}, frame_id="map")
    for other in (moved, other_frame, costs((7, 5)), finer):
        with pytest.raises(MessageError, match="expected the frame and grid of the first message"):
            to_update(convert(costs()), convert(other))


@KINDS
@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("x", 6, "expected a rectangle within 7 x 4 cells"),
        ("y", -1, "expected a rectangle within 7 x 4 cells"),
        ("data", b"\0", "data: expected 6 values, got 1"),
        ("header.frame_id", "odom", "header.frame_id: expected 'map', got 'odom'"),
    ],
)
def test_wrong_update_is_refused(convert, to_update, sides, name, value, text) -> None:  # noqa: ARG001
    changed = costs()
    values = changed.unwrapped("cost").copy()
    values[2:4, :3] = np.where(values[2:4, :3] == 254, 1, 254)
    changed.set_unwrapped("cost", values)
    grid = convert(costs())
    update = to_update(grid, convert(changed))
    *path, last = name.split(".")
    place = update
    for part in path:
        place = getattr(place, part)
    setattr(place, last, value)
    with pytest.raises(MessageError, match=text):
        apply_update(grid, update)
