# SPDX-License-Identifier: BSD-3-Clause
import math
from typing import Any

import numpy as np
import pytest
from cpp_golden import assert_header, cases
from geometry_msgs.msg import Point
from hypothesis import given, settings
from nav_msgs.msg import GridCells
from rclpy.serialization import deserialize_message
from wire import over_the_wire

from grid_map_core_py import GridMap, GridMapError
from grid_map_core_py.testing import grid_maps, moved_in_buffer
from grid_map_ros_py import MessageError, from_grid_cells, to_grid_cells, to_serialized_grid_cells


def centers(message: GridCells) -> list[list[float]]:
    return [[cell.x, cell.y, cell.z] for cell in message.cells]


@pytest.mark.parametrize(("grid_map", "case"), cases("to_grid_cells"))
def test_grid_cells_equal_cpp(grid_map: GridMap, case: dict[str, Any]) -> None:
    message = over_the_wire(to_grid_cells(grid_map, case["layer"], case["lower"], case["upper"]))
    assert_header(message.header, case["header"])
    assert np.float32(message.cell_width) == np.float32(case["cell_width"])
    assert np.float32(message.cell_height) == np.float32(case["cell_height"])
    assert centers(message) == case["cells"]


@given(grid_maps())
def test_grid_cells_have_finite_values_between_bounds(grid_map: GridMap) -> None:
    expected = [
        [*grid_map.get_position((row, column)), 0.0]
        for column in range(grid_map.size[1])
        for row in range(grid_map.size[0])
        if -200.0 <= grid_map["elevation"][row, column] <= 300.0
    ]
    bounds = ("elevation", -200.0, 300.0)
    message = to_grid_cells(grid_map, *bounds)
    assert centers(message) == expected
    assert deserialize_message(to_serialized_grid_cells(grid_map, *bounds), GridCells) == message


@pytest.mark.parametrize("shape", [(130, 151), (9001, 2), (2, 9001)])
def test_grid_cells_of_large_map_are_between_bounds(shape: tuple[int, int]) -> None:
    values = np.random.default_rng(1).random(shape, np.float32)
    grid_map = moved_in_buffer(GridMap(shape, 1.0, layers={"e": values}), (1, 1))
    data = to_serialized_grid_cells(grid_map, "e", 0.25, 0.5)
    chosen = (grid_map["e"] >= 0.25) & (grid_map["e"] <= 0.5)
    expected = grid_map.get_positions()[chosen.ravel("F")]
    found = np.array(centers(deserialize_message(data, GridCells)))
    np.testing.assert_array_equal(found[:, :2], expected)


def test_bounds_may_be_infinite_and_are_included() -> None:
    values = [[1.0, math.inf], [-math.inf, math.nan]]
    grid_map = GridMap((2, 2), 1.0, layers={"elevation": values, "rounded": 0.1})
    message = to_grid_cells(grid_map, "elevation", -math.inf, math.inf)
    assert centers(message) == [[0.5, 0.5, 0.0]]
    assert len(to_grid_cells(grid_map, "rounded", 0.1, 0.1).cells) == 4


@pytest.mark.parametrize("convert", [to_grid_cells, to_serialized_grid_cells])
def test_bounds_are_numbers_and_the_resolution_fits_a_float32(convert: Any) -> None:
    grid_map = GridMap((1, 1), 1.0, layers={"elevation": 0.1})
    with pytest.raises(MessageError, match=r"lower, upper: expected numbers, got \(0\.0, nan\)"):
        convert(grid_map, "elevation", 0.0, math.nan)
    with pytest.raises(GridMapError, match="lower: expected a number, got 'low'"):
        convert(grid_map, "elevation", "low", 1.0)
    large = GridMap((1e60, 1e60), 1e60, layers={"elevation": 0.1})
    with pytest.raises(MessageError, match=r"resolution: expected .* that float32 can hold"):
        convert(large, "elevation", 0.0, 1.0)


# --- reading --------------------------------------------------------------------------------------


def cells_message(*points: tuple[float, float], side: float = 0.1) -> GridCells:
    cells = [Point(x=x, y=y) for x, y in points]
    return GridCells(cell_width=side, cell_height=side, cells=cells)


@settings(max_examples=60)
@given(grid_maps())
def test_cells_are_covered_on_the_grid_of_their_map(grid_map: GridMap) -> None:
    message = to_grid_cells(grid_map, "elevation", -200.0, 300.0)
    received = from_grid_cells(message, "covered", geometry=grid_map.geometry)
    values = grid_map.unwrapped("elevation")
    expected = np.where((values >= -200.0) & (values <= 300.0), 1.0, np.nan)
    np.testing.assert_array_equal(received["covered"], expected)
    assert (received.frame_id, received.timestamp) == (grid_map.frame_id, grid_map.timestamp)
    assert received.start_index == (0, 0)


@settings(max_examples=60)
@given(grid_maps())
def test_default_geometry_has_the_cells_of_the_sender(grid_map: GridMap) -> None:
    message = to_grid_cells(grid_map, "elevation", -200.0, 300.0)
    if not message.cells:
        with pytest.raises(MessageError, match="cells: expected a cell, or a geometry for the map"):
            from_grid_cells(message, "covered")
        return
    received = from_grid_cells(message, "covered", grid_map.resolution)
    again = to_grid_cells(received, "covered", 1.0, 1.0)
    np.testing.assert_allclose(sorted(centers(again)), sorted(centers(message)), atol=1e-6)
    covered = np.isfinite(received["covered"])
    assert covered.any(axis=1)[[0, -1]].all()
    assert covered.any(axis=0)[[0, -1]].all()


def test_resolution_of_sender_survives_float32() -> None:
    sent = over_the_wire(cells_message((1.05, 2.05)))
    received = from_grid_cells(sent, "covered")
    assert received.resolution == 0.1
    assert from_grid_cells(sent, "covered", 0.1).size == (1, 1)
    np.testing.assert_allclose(received.position, (1.05, 2.05))


def test_cells_beside_the_grid_are_left_out() -> None:
    geometry = GridMap((0.2, 0.1), 0.1).geometry
    message = cells_message((0.05, 0.0), (0.15, 0.0), (-7.0, 0.0))
    received = from_grid_cells(message, "covered", geometry=geometry)
    np.testing.assert_array_equal(received["covered"], [[1.0], [math.nan]])
    nothing = from_grid_cells(cells_message(), "covered", geometry=geometry)
    assert np.isnan(nothing["covered"]).all()


MALFORMED: list[tuple[dict[str, Any], Any, str]] = [
    ({"cell_width": 0.2}, 0.1, "cell_width: expected the resolution 0.1, got 0.2"),
    ({"cell_height": 0.2}, 0.1, "cell_height: expected the resolution 0.1, got 0.2"),
    ({"cell_width": 0.0}, 0.1, "cell_width: expected a positive finite number, got 0.0"),
    ({"cells": [Point(x=math.nan)]}, 0.1, r"cells\[0\]: expected finite coordinates"),
    ({"cells": [Point(), Point(x=1e6, y=1e6)]}, 0.1, "extent from .* expected at most 16000000"),
    ({"cells": [Point(x=-1e308), Point(x=1e308)]}, 0.1, "extent from .*got inf x 1"),
    ({}, 0.0, "resolution: expected a"),
    ({}, math.nan, "resolution: expected a"),
    ({}, "fine", "resolution: expected a"),
]


@pytest.mark.parametrize(("changes", "resolution", "text"), MALFORMED)
def test_malformed_cells_get_one_error_that_names_the_field(
    changes: dict[str, Any], resolution: Any, text: str
) -> None:
    message = cells_message((0.0, 0.0))
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(GridMapError, match=text):
        from_grid_cells(message, "covered", resolution)
