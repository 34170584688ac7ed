# SPDX-License-Identifier: BSD-3-Clause
"""Blocks of the circular buffer, compared with the C++ library."""

import numpy as np

import golden
from grid_map_core_py import GridMap, submap_cells
from grid_map_core_py.map import _ring_buffer as ring_buffer

GEOMETRY = golden.load("geometry")


def test_positions_beyond_the_map_get_border_cell_as_in_cpp():
    for number, size, _, bounded in GEOMETRY["wrap_bound"]:
        grid_map = GridMap((size, size), 1.0)
        first = grid_map.get_position((0, 0))
        index, inside = grid_map.get_indices(first - number)
        assert golden.pairs(index) == [bounded, bounded]
        assert inside == (number == bounded)


def test_blocks_are_walked_in_the_order_of_cpp():
    assert GEOMETRY["increment_index"]
    for case in GEOMETRY["increment_index"]:
        grid_map = GridMap(case["size"], 1.0)
        grid_map.start_index = case["start_index"]
        cells = submap_cells(grid_map, case["start_index"], case["size"])
        assert golden.pairs(cells) == case["sequence"]


def test_blocks_are_stored_in_the_regions_that_cpp_names():
    rows = GEOMETRY["buffer_regions_4x3"]["rows"]
    layer = np.asfortranarray(np.arange(12, dtype=np.float32).reshape(4, 3))
    compared = 0
    for start, index, size, ok, regions in rows:
        if not ok:  # it reaches over the far border of the map
            continue
        first = np.subtract(index, start) % layer.shape
        block = ring_buffer.block(
            layer, start, *(slice(n, n + count) for n, count in zip(first, size, strict=True))
        )
        np.testing.assert_array_equal(block, put_together(layer, regions))
        compared += 1
    assert compared >= 300


def test_few_or_many_lines_begin_at_the_start_index():
    for repetitions in (1, 20_000):
        numbers = np.tile(np.arange(5), repetitions)
        ring_buffer.place(numbers, 2, 5)
        assert numbers.tolist() == [2, 3, 4, 0, 1] * repetitions


def put_together(layer: np.ndarray, regions: list[list]) -> np.ndarray:
    """Return the block whose quadrants are in these regions of the buffer."""
    quadrants = {name: layer[i : i + rows, j : j + cols] for i, j, rows, cols, name in regions}
    lines = [
        [quadrants[side + end] for end in ("Left", "Right") if side + end in quadrants]
        for side in ("Top", "Bottom")
    ]
    return np.block([line for line in lines if line])
