# SPDX-License-Identifier: BSD-3-Clause
import math
import sys
from typing import Any

import numpy as np
import pytest
from cpp_golden import assert_header, assert_pose, cases, to_grid, to_map
from hypothesis import HealthCheck, given, settings
from nav2_stand_in import Costmap, LaterPyCostmap2D, PyCostmap2D

from grid_map_core_py import GeometryError, GridMap, GridMapError
from grid_map_core_py.conversions import CostRange
from grid_map_core_py.testing import grid_maps
from grid_map_ros_py import (
    MissingPackageError,
    from_costmap,
    from_occupancy_grid,
    to_costmap,
    to_occupancy_grid,
)
from grid_map_ros_py.messages import OCCUPANCIES, STATIC_LAYER

pytestmark = pytest.mark.usefixtures("nav2")


TO_COSTMAP = cases("to_costmap")
FROM_COSTMAP = [case for _, case in cases("from_costmap")]


def test_costmaps_equal_cpp() -> None:
    compared = [(m, case) for m, case in TO_COSTMAP if case["data_min"] != case["data_max"]]
    assert len(compared) == 12
    for grid_map, case in compared:
        message = to_costmap(grid_map, case["layer"], case["data_min"], case["data_max"])
        expected = case["costmap"]
        assert_header(message.header, expected["header"])
        assert_pose(message.metadata.origin, expected["origin"])
        for name in ("resolution", "size_x", "size_y"):
            assert getattr(message.metadata, name) == expected[name]
        assert message.data.tolist() == expected["data"]
        assert message.metadata.layer == case["layer"]
        assert message.metadata.update_time == message.header.stamp


def test_empty_range_is_refused_where_cpp_divides_by_zero() -> None:
    refused = [(m, case) for m, case in TO_COSTMAP if case["data_min"] == case["data_max"]]
    assert len(refused) == 4
    for grid_map, case in refused:
        with pytest.raises(GeometryError, match="expected two different finite float32 numbers"):
            to_costmap(grid_map, case["layer"], case["data_min"], case["data_max"])


@pytest.mark.parametrize("read", [lambda message: message, LaterPyCostmap2D])
def test_maps_equal_cpp(read: Any) -> None:
    assert len(FROM_COSTMAP) == 16
    for case in FROM_COSTMAP:
        grid_map = from_costmap(read(to_grid(Costmap(), case["costmap"])), "cost")
        expected = case["result"]
        # The C++ library continues with 0.1 rounded to float32; this one restores 0.1.
        assert grid_map.resolution == round(expected["resolution"], 6)
        expected = to_map(expected)
        np.testing.assert_allclose(grid_map.position, expected.position, atol=1e-7)
        assert (grid_map.size, grid_map.timestamp) == (expected.size, expected.timestamp)
        assert grid_map.frame_id == expected.frame_id
        np.testing.assert_array_equal(grid_map["cost"], expected["cost"])


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(grid_maps())
def test_costmap_round_trip_keeps_position_and_costs(grid_map: GridMap) -> None:
    message = to_costmap(grid_map, "elevation", -1000.0, 1000.0)
    received = from_costmap(message, "cost")
    assert (received.size, received.resolution) == (grid_map.size, grid_map.resolution)
    np.testing.assert_allclose(received.position, grid_map.position, atol=1e-9)
    assert to_costmap(received, "cost").data == message.data


def occupancy_in_nav2(cost: int) -> int:
    """Return the occupancy that a costmap of Nav2 publishes for a cost."""
    named = {0: 0, 253: 99, 254: 100, 255: -1}
    return named[cost] if cost in named else 1 + 97 * (cost - 1) // 251


def test_all_costs_become_the_occupancies_of_nav2() -> None:
    costs = np.append(np.arange(255, dtype=np.float32), np.nan).reshape(32, 8)
    grid_map = GridMap((3.2, 0.8), 0.1, layers={"cost": 0.0})
    grid_map.move((0.5, -0.3))
    grid_map.set_unwrapped("cost", costs)
    expected = [occupancy_in_nav2(cost) for cost in range(256)]
    grid = to_occupancy_grid(grid_map, "cost", codec=CostRange())
    assert grid.data.tolist() == np.reshape(expected, (32, 8)).ravel("F")[::-1].tolist()
    values = OCCUPANCIES.to_values(np.arange(256))
    assert np.nan_to_num(values, nan=-1).tolist() == expected


def test_both_inverses_of_occupancies_follow_nav2() -> None:
    known = [math.floor(254 * occupancy / 100) for occupancy in range(101)]
    assert STATIC_LAYER.to_costs([*range(101), -1]).tolist() == [*known, 255]
    costs = OCCUPANCIES.to_costs([*range(101), math.nan]).tolist()
    assert [occupancy_in_nav2(cost) for cost in costs] == [*range(101), -1]
    assert (costs[99], known[99]) == (253, 251)
    unusual = OCCUPANCIES.to_costs([-1.0, math.inf, -math.inf, 98.6]).tolist()
    assert unusual == [255, 254, 255, 253]


def test_occupancies_survive_the_way_through_maps() -> None:
    occupancies = GridMap((10.2, 0.1), 0.1, layers={"o": [[math.nan], *([k] for k in range(101))]})
    grid = to_occupancy_grid(occupancies, "o", codec=OCCUPANCIES)
    assert grid.data.tolist() == [*range(100, -1, -1), -1]
    costs = to_costmap(from_occupancy_grid(grid, "o"), "o", codec=OCCUPANCIES)
    assert to_occupancy_grid(from_costmap(costs, "c"), "c", codec=CostRange()) == grid
    # On Jazzy, this class holds occupancy values.
    assert to_occupancy_grid(from_costmap(PyCostmap2D(grid), "c"), "c", codec=CostRange()) == grid


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("size_x", 4),
        ("costmap", np.zeros((3, 2), np.uint8)),
        ("costmap", np.full(6, 256)),
        ("costmap", np.full(6, 101)),
        ("resolution", -1.0),
        ("origin_y", math.nan),
    ],
)
def test_invalid_py_costmap_is_refused(name: str, value: object) -> None:
    costmap = PyCostmap2D(to_occupancy_grid(GridMap((3, 2), 1.0, layers={"e": 0.0}), "e", 0, 1))
    setattr(costmap, name, value)
    with pytest.raises(GridMapError):
        from_costmap(costmap, "cost")


def test_missing_nav2_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nav2_msgs.msg", None)
    with pytest.raises(
        MissingPackageError, match=r"to_costmap needs the package 'nav2_msgs'.*nav2-m"
    ):
        to_costmap(GridMap((1, 1), 1.0, layers={"e": 0.0}), "e")
