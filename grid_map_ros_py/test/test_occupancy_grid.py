# SPDX-License-Identifier: BSD-3-Clause
import array
import math
from typing import Any

import numpy as np
import pytest
from cpp_golden import assert_header, assert_pose, cases, to_grid, to_map
from geometry_msgs.msg import Quaternion
from hypothesis import given
from nav_msgs.msg import OccupancyGrid
from wire import over_the_wire, set_field

from grid_map_core_py import GridMap, GridMapError
from grid_map_core_py.testing import grid_maps
from grid_map_ros_py import (
    MessageError,
    from_costmap,
    from_occupancy_grid,
    to_costmap,
    to_occupancy_grid,
)
from grid_map_ros_py.messages import OCCUPANCIES


@pytest.mark.parametrize(("grid_map", "case"), cases("to_occupancy_grid"))
def test_occupancy_grids_equal_cpp(grid_map: GridMap, case: dict[str, Any]) -> None:
    arguments = (grid_map, case["layer"], case["data_min"], case["data_max"])
    if case["data_min"] == case["data_max"]:
        with pytest.raises(MessageError, match="data_min, data_max: expected two different"):
            to_occupancy_grid(*arguments)
        return
    grid, expected = over_the_wire(to_occupancy_grid(*arguments)), case["grid"]
    assert_header(grid.header, expected["header"])
    load_time = grid.info.map_load_time
    assert [load_time.sec, load_time.nanosec] == expected["map_load_time"]
    assert_pose(grid.info.origin, expected["origin"])
    for name in ("resolution", "width", "height"):
        assert getattr(grid.info, name) == expected[name]
    assert grid.data.tolist() == expected["data"]


@pytest.mark.parametrize("case", [case for _, case in cases("from_occupancy_grid")])
def test_maps_equal_cpp(case: dict[str, Any]) -> None:
    grid_map = from_occupancy_grid(to_grid(OccupancyGrid(), case["grid"]), "occ")
    expected = to_map(case["result"])
    assert (grid_map.size, grid_map.start_index) == (expected.size, (0, 0))
    assert (grid_map.frame_id, grid_map.timestamp) == (expected.frame_id, expected.timestamp)
    # The C++ library continues with 0.1 rounded to float32; this one restores 0.1.
    np.testing.assert_allclose(grid_map.position, expected.position, atol=1e-7)
    assert grid_map.resolution == round(expected.resolution, 6)
    np.testing.assert_array_equal(grid_map["occ"], expected["occ"])


def occupancy_of(value: float, low: float, high: float) -> int:
    """Return one occupancy by the definition, in float32 like the layers."""
    if math.isnan(value):
        return -1
    with np.errstate(over="ignore"):
        share = (np.float32(value) - np.float32(low)) / (np.float32(high) - np.float32(low))
    return math.trunc(float(np.float32(100) * min(max(share, np.float32(0)), np.float32(1))))


@given(grid_maps())
def test_grid_begins_at_smallest_x_and_y(grid_map: GridMap) -> None:
    grid = over_the_wire(to_occupancy_grid(grid_map, "elevation", 200.0, -300.0))
    rows, columns = grid_map.size
    origin = grid.info.origin.position
    assert (grid.info.width, grid.info.height) == (rows, columns)
    for k, occupancy in enumerate(grid.data):
        x = origin.x + (k % rows + 0.5) * grid_map.resolution
        y = origin.y + (k // rows + 0.5) * grid_map.resolution
        value = grid_map["elevation"][grid_map.get_index((x, y))]
        assert occupancy == occupancy_of(value, 200.0, -300.0)


@given(grid_maps())
def test_occupancy_grid_round_trip_keeps_position_and_values(grid_map: GridMap) -> None:
    message = over_the_wire(to_occupancy_grid(grid_map, "elevation", -1000.0, 1000.0))
    received = from_occupancy_grid(message, "occupancy")
    assert received.size == grid_map.size
    assert received.resolution == grid_map.resolution
    np.testing.assert_allclose(received.position, grid_map.position, atol=1e-9)
    sent_again = to_occupancy_grid(received, "occupancy", codec=OCCUPANCIES)
    assert sent_again.data == message.data


def test_infinities_are_clamped_and_nan_is_unknown() -> None:
    values = [[math.nan], [-math.inf], [math.inf]]
    grid_map = GridMap((3, 1), 1.0, layers={"elevation": values})
    assert to_occupancy_grid(grid_map, "elevation", 0.0, 1.0).data.tolist() == [100, 0, -1]
    assert to_occupancy_grid(grid_map, "elevation", 1.0, 0.0).data.tolist() == [0, 100, -1]


@pytest.mark.parametrize(
    "bounds",
    [(0.1, 0.1 + 1e-12), (math.nan, 1.0), (0.0, math.inf), (-3.4e38, 3.4e38), (0.0, "high")],
)
def test_bounds_without_a_usable_difference_are_refused(bounds: Any) -> None:
    grid_map = GridMap((1, 1), 1.0, layers={"elevation": 0.0})
    with pytest.raises(GridMapError, match=r"data_max: expected (two different finite|a number)"):
        to_occupancy_grid(grid_map, "elevation", *bounds)


# --- errors of occupancy grids and costmaps alike -------------------------------------------------

GRIDS: dict[str, tuple[Any, Any, list[str]]] = {
    "occupancy grid": (
        lambda grid_map: to_occupancy_grid(grid_map, "e", 0, 1),
        from_occupancy_grid,
        ["info", "width", "height"],
    ),
    "costmap": (
        lambda grid_map: to_costmap(grid_map, "e"),
        from_costmap,
        ["metadata", "size_x", "size_y"],
    ),
}
alike = pytest.mark.parametrize(("write", "read", "names"), GRIDS.values(), ids=GRIDS)
pytestmark = pytest.mark.usefixtures("nav2")

MALFORMED = {
    "no cells along x": ("{0}.{1}", 0, "{0}.{1}: expected at least one cell, got 0"),
    "no cells along y": ("{0}.{2}", 0, "{0}.{2}: expected at least one cell, got 0"),
    "too many cells": ("{0}.{1}", 2**31 - 1, "data: expected 4294967294 values"),
    "more cells than any map": ("{0}.{1}", 2**32 - 1, "{0}: expected a grid of finite size"),
    "too little data": ("data", 1, "data: expected 6 values .*got 1"),
    "too much data": ("data", 7, "data: expected 6 values .*got 7"),
    "resolution zero": ("{0}.resolution", 0.0, "{0}.resolution: expected a positive.*got 0.0"),
    "origin nan": ("{0}.origin.position.x", math.nan, "{0}.origin.position.x: .*got nan"),
    "rotated": (
        "{0}.origin.orientation",
        Quaternion(z=1.0, w=0.0),
        r"{0}.origin.orientation: expected the identity.*got \(0.0, 0.0, 1.0, 0.0\)",
    ),
    "before the epoch": ("header.stamp.sec", -1, "header.stamp.sec: expected no negative"),
}


@alike
@pytest.mark.parametrize("kind", MALFORMED)
def test_malformed_grid_gets_one_error_that_names_the_field(
    write: Any, read: Any, names: list[str], kind: str
) -> None:
    path, value, text = MALFORMED[kind]
    message = write(GridMap((3, 2), 1.0, layers={"e": 0.0}))
    if path == "data":
        value = array.array(message.data.typecode, [0] * value)
    set_field(message, path.format(*names), value)
    with pytest.raises(MessageError, match=text.format(*names)):
        read(message, "layer")


@alike
@pytest.mark.parametrize("resolution", [1e-60, 1e60])
def test_resolution_that_float32_cannot_hold_is_refused(
    write: Any, read: Any, names: list[str], resolution: float
) -> None:
    grid_map = GridMap((resolution, resolution), resolution, layers={"e": 0.0})
    with pytest.raises(MessageError, match=r"resolution: expected .* that float32 can hold"):
        write(grid_map)
    message = write(GridMap((2, 2), 1.0, layers={"e": 0.0}))
    set_field(message, f"{names[0]}.resolution", resolution)
    with pytest.raises(MessageError, match=f"{names[0]}: expected a grid of finite size and place"):
        read(message, "layer")
