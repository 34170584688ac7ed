# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Every number of the C++ converters is compared by a test."""

from pathlib import Path

import pytest
from cpp_golden import cases, counts, to_map

from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py import from_message, to_message

COMPARED = {
    "to_point_cloud": (20, "test_point_cloud.py"),
    "to_occupancy_grid": (16, "test_occupancy_grid.py"),
    "from_occupancy_grid": (32, "test_occupancy_grid.py"),
    "to_costmap": (16, "test_costmap.py"),
    "from_costmap": (16, "test_costmap.py"),
    "to_grid_cells": (16, "test_grid_cells.py"),
    "to_message": (4, "test_grid_map.py"),
    "to_message_layers_full": (4, "test_grid_map.py"),
    "from_message": (4, "test_grid_map.py"),
    "from_message_only_full_no_basic": (4, "test_cpp_golden.py"),
    "images": (24, "test_image.py"),
}


def test_every_converter_is_compared_with_cpp() -> None:
    assert counts() == {family: number for family, (number, _) in COMPARED.items()}


@pytest.mark.parametrize("family", COMPARED)
def test_file_that_compares_a_converter_reads_its_cases(family: str) -> None:
    file = Path(__file__).with_name(COMPARED[family][1])
    assert f'cases("{family}")' in file.read_text()


def test_one_layer_without_basic_layers_is_read_as_by_cpp() -> None:
    compared = cases("from_message_only_full_no_basic")
    assert len(compared) == 4
    for grid_map, case in compared:
        grid_map.basic_layers = ["elevation"]
        received = from_message(to_message(grid_map), ["full"], copy_basic_layers=False)
        assert_maps_equal(received, to_map(case["result"]))
        assert received.basic_layers == ()
