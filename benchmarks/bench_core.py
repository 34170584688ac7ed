# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of map operations: moves, submaps, indices and positions."""

import numpy as np
import pytest
from terrain import RESOLUTION, moved_terrain, terrain

POINTS = 1_000_000
STEP = np.array([10, 7]) * RESOLUTION


def make(cells, moved):
    return moved_terrain(cells) if moved else terrain(cells)


MOVED = pytest.mark.parametrize("moved", [False, True], ids=["as made", "moved"])


def test_move(measure, cells):
    grid_map = terrain(cells)

    def move():
        grid_map.move(grid_map.position - STEP)
        return grid_map.start_index, grid_map.position

    def come_back():
        grid_map.position = (0.0, 0.0)
        grid_map.start_index = (0, 0)
        return ()

    start, position = measure("move(10,7 cells)", cells, move, prepare=come_back)
    assert start == (10, 7)
    np.testing.assert_allclose(position, -STEP)


def test_convert_to_default_start_index(measure, cells):
    original = moved_terrain(cells)

    def convert(grid_map):
        grid_map.convert_to_default_start_index()
        return grid_map

    row = "convertToDefaultStartIndex after move"
    result = measure(row, cells, convert, prepare=lambda: (original.copy(),))
    assert result.start_index == (0, 0)
    expected = np.roll(original["elevation"], (-10, -7), axis=(0, 1))
    np.testing.assert_array_equal(result["elevation"], expected)


@MOVED
def test_submap(measure, cells, moved):
    grid_map = make(cells, moved)
    row = f"getSubmap half side ({'moved map' if moved else 'start index 0'})"
    center, length = grid_map.position, 0.5 * grid_map.length
    result = measure(row, cells, lambda: grid_map.get_submap(center, length))
    quarter = cells // 4
    expected = grid_map.unwrapped("elevation")[quarter : 3 * quarter, quarter : 3 * quarter]
    np.testing.assert_array_equal(result["elevation"], expected)


@MOVED
def test_indices_of_positions(measure, cells, moved):
    grid_map = make(cells, moved)
    spread = np.random.default_rng(1).uniform(-0.49, 0.49, (POINTS, 2))
    positions = grid_map.position + spread * grid_map.length
    row = "getIndex x1e6" + " (moved map)" * moved
    indices, inside = measure(row, cells, lambda: grid_map.get_indices(positions))
    assert inside.all()
    distance = np.abs(grid_map.get_positions(indices) - positions)
    assert distance.max() <= 0.5 * RESOLUTION + 1e-9


@MOVED
def test_positions_of_indices(measure, cells, moved):
    grid_map = make(cells, moved)
    indices = np.random.default_rng(1).integers(0, cells, (POINTS, 2))
    row = "getPosition x1e6" + " (moved map)" * moved
    positions = measure(row, cells, lambda: grid_map.get_positions(indices))
    again, inside = grid_map.get_indices(positions)
    assert inside.all()
    np.testing.assert_array_equal(np.stack(again, axis=-1), indices)
