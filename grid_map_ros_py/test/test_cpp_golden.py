# SPDX-License-Identifier: BSD-3-Clause
"""Every number of the C++ converters is compared by a test."""

from pathlib import Path

from cpp_golden import cases, counts, to_map

from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py import from_message, to_message

COMPARED = {
    "to_point_cloud": 20,
    "to_occupancy_grid": 16,
    "from_occupancy_grid": 32,
    "to_costmap": 16,
    "from_costmap": 16,
    "to_grid_cells": 16,
    "to_message": 4,
    "to_message_layers_full": 4,
    "from_message": 4,
    "from_message_only_full_no_basic": 4,
    "images": 24,
}


def test_every_converter_is_compared_with_cpp() -> None:
    assert counts() == COMPARED
    code = "".join(file.read_text() for file in Path(__file__).parent.glob("test_*.py"))
    assert [family for family in COMPARED if f'cases("{family}")' not in code] == []


def test_one_layer_without_basic_layers_is_read_as_by_cpp() -> None:
    compared = cases("from_message_only_full_no_basic")
    assert len(compared) == 4
    for grid_map, case in compared:
        grid_map.basic_layers = ["elevation"]
        received = from_message(to_message(grid_map), ["full"], copy_basic_layers=False)
        assert_maps_equal(received, to_map(case["result"]))
        assert received.basic_layers == ()
