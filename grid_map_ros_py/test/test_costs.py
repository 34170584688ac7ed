# SPDX-License-Identifier: BSD-3-Clause
"""Costs of the `costmap` node: checks, windows and the transform to another frame."""

import itertools
import math
import re

import cv2
import numpy as np
import pytest

from grid_map_core_py import GridMap, GridMapError
from grid_map_core_py.conversions._costmap import FREE, LETHAL
from grid_map_ros_py._costs import aligned, check_costs, planar, resampled
from grid_map_ros_py.nodes._poses import from_xyz_rpy


def costs(
    shape: tuple[int, int], resolution: float = 0.1, shift: float = 0.3, frame_id: str = "odom"
) -> GridMap:
    """Return a moved map with random costs, some of them unknown."""
    length, layers = np.multiply(shape, resolution), {"cost": 0.0}
    grid_map = GridMap(length, resolution, layers=layers, frame_id=frame_id, timestamp=7)
    grid_map.move((shift, -0.2))
    random = np.random.default_rng(sum(shape))
    grid_map["cost"] = random.integers(0, 255, shape)
    grid_map["cost"][random.random(shape) < 0.2] = np.nan
    return grid_map


@pytest.mark.parametrize("value", [-1.0, 255.0, 0.5, 253.5, 1e9, math.inf, -math.inf])
def test_values_that_are_no_costs_are_refused(value: float) -> None:
    grid_map = costs((3, 2))
    check_costs(grid_map, "cost")
    grid_map["cost"][1, 1] = value
    text = f"layer 'cost': expected whole costs from 0 to 254 or NaN, got {value:g}. Compute"
    with pytest.raises(GridMapError, match=re.escape(text)):
        check_costs(grid_map, "cost")


@pytest.mark.parametrize("shape", [(1, 1), (23, 12), (24, 13)])
@pytest.mark.parametrize("step", [1, 5, 8])
@pytest.mark.parametrize("shift", np.arange(-4, 5) * 0.1)
def test_window_is_the_largest_aligned_one(shape: tuple[int, int], step: int, shift: float) -> None:
    grid_map = costs(shape, shift=shift)
    lower = np.rint((grid_map.position - 0.5 * grid_map.length) / 0.1 - 0.01).astype(int)
    sides = [
        [cell for cell in range(begin, begin + count + 1) if cell % step == 0]
        for begin, count in zip(lower.tolist(), shape, strict=True)
    ]
    if min(map(len, sides)) < 2:
        with pytest.raises(GridMapError, match=r"origin_grid: expected . x . aligned cells"):
            aligned(grid_map, step)
        return
    window = aligned(grid_map, step)
    assert window.size == tuple(side[-1] - side[0] for side in sides)
    expected = grid_map.get_submap(window.position, window.length)
    np.testing.assert_allclose(window.position, expected.position)
    np.testing.assert_array_equal(window.unwrapped("cost"), expected["cost"])


def test_planar_transform_refuses_tilted_frames() -> None:
    found = planar(from_xyz_rpy((1, 2, 3), np.radians([4.9, -4.9, 120])), "odom", "map")
    np.testing.assert_allclose(found, (1, 2, math.radians(120)), atol=0.01)
    for tilt in ((5.1, 0, 0), (0, -5.1, 0), (180, 0, 0)):
        text = "frame 'odom': expected roll and pitch of at most 5 deg in 'map', got .* deg. Choose"
        with pytest.raises(GridMapError, match=text):
            planar(from_xyz_rpy((0, 0, 0), np.radians(tilt)), "odom", "map")


CORNERS = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


@pytest.mark.parametrize(
    ("shape", "resolution", "yaw"),
    [
        *(((9, 5), 0.1, 0.7), ((4, 6), 0.1, -2.1), ((6, 3), 0.25, 3.0), ((9, 8), 0.75, 0.4)),
        *(((1, 1), 0.1, 0.5 * math.pi), ((1, 1), 7.0, 0.2)),
        *(((9, 5), 0.1, 0.0), ((6, 7), 0.07, 0.0), ((9, 8), 0.75, 0.0)),
    ],
)
@pytest.mark.parametrize(("source", "worst_below_unknown"), [(0.1, LETHAL), (0.2, FREE)])
def test_target_cells_get_the_worst_cost_they_touch(
    worst_below_unknown: int, shape: tuple[int, int], resolution: float, yaw: float, source: float
) -> None:
    """OpenCV intersects each pair of cells; overlaps below 1e-3 of a cell may count or not."""
    grid_map, transform = costs(shape, source), (1.03, -0.4, yaw)
    result = resampled(grid_map, "cost", transform, "map", resolution, worst_below_unknown)
    assert (result.frame_id, result.timestamp) == ("map", grid_map.timestamp)
    lower = (result.position - 0.5 * result.length) / resolution
    np.testing.assert_allclose(lower, np.rint(lower), atol=1e-9)

    def rank(cost: float) -> float:
        return worst_below_unknown + 0.5 if math.isnan(cost) else cost

    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    known = 0
    for row, column in itertools.product(*map(range, result.size)):
        center = result.get_position((row, column))
        least = most = -1.0
        for cell in itertools.product(*map(range, grid_map.size)):
            place = turn @ grid_map.get_position(cell) + transform[:2]
            turned = (place - center) / source + CORNERS @ turn.T
            square = CORNERS * resolution / source
            area, _ = cv2.intersectConvexConvex(np.float32(turned), np.float32(square))
            found = rank(grid_map["cost"][cell])
            most = max(most, found if area > 0 else -1)
            least = max(least, found if area > 1e-3 else -1)
        cost = result["cost"][row, column]
        if math.isnan(cost) and least < 0:
            continue
        assert least <= rank(cost) <= most, (row, column)
        known += 1
    assert known >= grid_map["cost"].size * (source / resolution) ** 2


@pytest.mark.parametrize("offset", [0.0, 1e-7, 0.05, -0.02])
def test_origin_becomes_a_multiple_of_the_resolution(offset: float) -> None:
    """Unknown is worse than all costs, unless it is only worse than a given one."""
    grid_map = costs((6, 4))
    grid_map.position = grid_map.position + (offset, 0)
    values = np.array([3, 254, np.nan, 253, np.nan, 252.0])
    grid_map["cost"] = np.tile(np.roll(values, grid_map.start_index[0]), (4, 1)).T
    result = resampled(grid_map, "cost", (0.0, 0.0, 0.0), "odom", 0.1)
    if abs(offset) < 1e-4:
        assert result is grid_map
        return
    lower = (result.position - 0.5 * result.length) / 0.1
    np.testing.assert_allclose(lower, np.rint(lower), atol=1e-9)
    expected = [3, 254, np.nan, np.nan, np.nan, np.nan, 252]
    np.testing.assert_array_equal(result["cost"], np.tile(expected, (4, 1)).T)
    result = resampled(grid_map, "cost", (0.0, 0.0, 0.0), "odom", 0.1, FREE)
    expected = [3, 254, 254, 253, 253, 252, 252]
    np.testing.assert_array_equal(result["cost"], np.tile(expected, (4, 1)).T)


def test_very_large_cells_need_no_more_memory() -> None:
    result = resampled(costs((20, 30)), "cost", (0.0, 0.0, 0.3), "map", 1e6, 0)
    assert result.size == (2, 2)
    assert np.nanmax(result["cost"]) == np.nanmax(costs((20, 30))["cost"])


def test_too_fine_resolution_is_refused() -> None:
    with pytest.raises(GridMapError, match="resolution: expected at most 16000000 cells"):
        resampled(costs((1, 1)), "cost", (0.0, 0.0, 0.0), "map", 1e-5)
