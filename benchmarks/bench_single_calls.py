# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of a thousand calls, each for one position, one cell or one small operation.

A time in milliseconds therefore equals the time of one call in microseconds. The map size hardly
matters.
"""

import numpy as np
import pytest
from terrain import RESOLUTION, moved_terrain

from grid_map_core_py import GridMap, Interpolation
from grid_map_core_py.regions import Polygon, circle_cells, line_cells, polygon_cells

CALLS = 1000
CELLS = 400


@pytest.fixture
def grid_map():
    return moved_terrain(CELLS)


@pytest.fixture
def positions(grid_map):
    """Return the argument (x, y) of each call, on the map."""
    spread = np.random.default_rng(1).uniform(-0.49, 0.49, (CALLS, 2))
    return [tuple(position) for position in (grid_map.position + spread * grid_map.length).tolist()]


@pytest.fixture
def indices():
    rows = np.random.default_rng(1).integers(0, CELLS, (CALLS, 2))
    return [tuple(index) for index in rows.tolist()]


@pytest.fixture
def each(measure):
    """Return a function that times one call per argument and returns the results."""

    def run(row, call, arguments):
        return measure(f"{row} x{CALLS}", CELLS, lambda: [call(one) for one in arguments])

    return run


def test_get_index(each, grid_map, positions):
    found = each("get_index of one", grid_map.get_index, positions)
    np.testing.assert_array_equal(np.transpose(found), grid_map.get_indices(positions)[0])


def test_is_inside(each, grid_map, positions):
    assert all(each("is_inside of one", grid_map.is_inside, positions))


def test_get_position(each, grid_map, indices):
    found = each("get_position of one", grid_map.get_position, indices)
    np.testing.assert_array_equal(found, grid_map.get_positions(indices))


def test_get_position3(each, grid_map, indices):
    found = each("get_position3", lambda index: grid_map.get_position3("elevation", index), indices)
    heights = grid_map["elevation"][tuple(np.transpose(indices))]
    np.testing.assert_array_equal(np.transpose(found)[2], heights)


def test_is_valid(each, grid_map, indices):
    found = each("is_valid of one", lambda index: grid_map.is_valid(index, "elevation"), indices)
    np.testing.assert_array_equal(found, grid_map.is_valid(indices, "elevation"))


@pytest.mark.parametrize("method", Interpolation, ids=lambda method: method.value)
def test_at_position(each, grid_map, positions, method):
    def value(position):
        return grid_map.at_position("elevation", position, method)

    found = each(f"at_position of one, {method.value}", value, positions)
    np.testing.assert_array_equal(found, grid_map.at_position("elevation", positions, method))


def test_new_map(each):
    found = each(
        "GridMap(...) without layers", lambda side: GridMap((side, 2.0), 0.5), [3.0] * CALLS
    )
    assert {one.size for one in found} == {(6, 4)}


def test_small_submap(each, grid_map):
    submaps = each(
        "get_submap of 10 x 10 cells",
        lambda center: grid_map.get_submap(center, (10 * RESOLUTION, 10 * RESOLUTION)),
        [grid_map.get_position((50, 60)) + 0.5 * RESOLUTION] * CALLS,
    )
    np.testing.assert_array_equal(submaps[0]["elevation"], grid_map["elevation"][45:55, 55:65])


def test_small_circle(each, grid_map):
    found = each(
        "circle_cells of 80", lambda center: circle_cells(grid_map, center, 0.25), [(1, 1)] * CALLS
    )
    centers = grid_map.get_positions(found[0])
    assert len(centers) > 70
    assert (np.hypot(*(centers - 1).T) <= 0.25 + 1e-9).all()


def test_short_line(each, grid_map):
    found = each(
        "line_cells of 41", lambda end: line_cells(grid_map, (0, 0), end), [(2, 1)] * CALLS
    )
    assert {rows.size for rows, _ in found} == {41}


def test_small_polygon(each, grid_map):
    triangle = Polygon([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    found = each(
        "polygon_cells of 200", lambda shape: polygon_cells(grid_map, shape), [triangle] * CALLS
    )
    assert triangle.is_inside(grid_map.get_positions(found[0])).all()
