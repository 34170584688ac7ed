# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
import math
from typing import Any

import numpy as np
import pytest
from cpp_golden import assert_header, cases
from hypothesis import given, settings
from nav_msgs.msg import GridCells
from rclpy.serialization import deserialize_message, serialize_message

from grid_map_core_py import GridMap, LayerNotFoundError
from grid_map_core_py.testing import grid_maps
from grid_map_ros_py import to_grid_cells, to_serialized_grid_cells


def centres(message: GridCells) -> list[list[float]]:
    return [[cell.x, cell.y, cell.z] for cell in message.cells]


@pytest.mark.parametrize(("grid_map", "case"), cases("to_grid_cells"))
def test_cells_equal_those_of_the_cpp_library(grid_map: GridMap, case: dict[str, Any]) -> None:
    sent = to_grid_cells(grid_map, case["layer"], case["lower"], case["upper"])
    message = deserialize_message(serialize_message(sent), GridCells)
    assert_header(message.header, case["header"])
    assert np.float32(message.cell_width) == np.float32(case["cell_width"])
    assert np.float32(message.cell_height) == np.float32(case["cell_height"])
    assert centres(message) == case["cells"]


@settings(max_examples=40)
@given(grid_maps())
def test_cells_are_those_with_finite_values_between_the_bounds(grid_map: GridMap) -> None:
    expected = [
        [*grid_map.get_position((row, column)), 0.0]
        for column in range(grid_map.size[1])
        for row in range(grid_map.size[0])
        if -200.0 <= grid_map["elevation"][row, column] <= 300.0
    ]
    assert centres(to_grid_cells(grid_map, "elevation", -200.0, 300.0)) == expected


@settings(max_examples=40)
@given(grid_maps())
def test_serialized_cells_are_the_same_message(grid_map: GridMap) -> None:
    bounds = ("elevation", -200.0, 300.0)
    serialized = to_serialized_grid_cells(grid_map, *bounds)
    assert deserialize_message(serialized, GridCells) == to_grid_cells(grid_map, *bounds)


def test_infinite_bounds_take_all_finite_cells() -> None:
    values = [[1.0, math.inf], [-math.inf, math.nan]]
    grid_map = GridMap((2, 2), 1.0, layers={"elevation": values})
    message = to_grid_cells(grid_map, "elevation", -math.inf, math.inf)
    assert centres(message) == [[0.5, 0.5, 0.0]]


def test_bounds_are_included_although_the_layer_is_rounded_to_float32() -> None:
    grid_map = GridMap((1, 1), 1.0, layers={"elevation": 0.1})
    assert len(to_grid_cells(grid_map, "elevation", 0.1, 0.1).cells) == 1


def test_an_unknown_layer_is_named() -> None:
    for convert in (to_grid_cells, to_serialized_grid_cells):
        with pytest.raises(LayerNotFoundError, match="'slope'; available: elevation"):
            convert(GridMap((1, 1), 1.0, layers=["elevation"]), "slope", 0, 1)
