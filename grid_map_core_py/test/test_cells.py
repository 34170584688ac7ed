# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Regions of cells, in the order of the contract."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import golden
from grid_map_core_py import (
    GeometryError,
    GridMap,
    OutOfMapError,
    circle_cells,
    map_cells,
    submap_cells,
)
from grid_map_core_py.testing import grid_maps

CASES = golden.cases("iterators")
by_map = pytest.mark.parametrize(("name", "case"), CASES, ids=[name for name, _ in CASES])


def golden_map(name: str) -> GridMap:
    return golden.to_map(golden.load("iterators")["maps"][name])


@by_map
def test_map_cells_equal_cpp(name, case):
    assert map_cells(golden_map(name)).tolist() == case["grid_map"]["index"]


@by_map
def test_submap_cells_equal_cpp(name, case):
    grid_map = golden_map(name)
    for submap in case["submap"]:
        cells = submap_cells(grid_map, submap["submap_start_index"], submap["submap_size"])
        assert cells.tolist() == submap["index"]


@by_map
def test_circle_cells_equal_cpp(name, case):
    """Except for rims that C++ decides by rounding (contract 3: discs are closed within 1e-9 m)."""
    grid_map = golden_map(name)
    compared = 0
    for circle in case["circle"]:
        cells = circle_cells(grid_map, circle["center"], circle["radius"]).tolist()
        if touches_a_centre(grid_map, circle["center"], circle["radius"]):
            assert cells == disc_by_hand(grid_map, circle["center"], circle["radius"])
            continue
        assert cells == circle["index"]
        compared += 1
    assert compared >= 20


def touches_a_centre(grid_map, center, radius):
    distances = np.linalg.norm(grid_map.get_positions() - center, axis=1)
    return (np.abs(distances - radius) <= 1e-9).any()


def disc_by_hand(grid_map, center, radius):
    """Oracle: walk over the map row by row from its corner and look at each centre."""
    rows, columns = grid_map.size
    cells = []
    for row in range(rows):
        for column in range(columns):
            index = [
                (row + grid_map.start_index[0]) % rows,
                (column + grid_map.start_index[1]) % columns,
            ]
            if np.linalg.norm(grid_map.get_position(index) - center) <= radius + 1e-9:
                cells.append(index)
    return cells


@given(grid_maps(), st.floats(-2, 2), st.floats(-2, 2), st.floats(0, 8))
def test_circle_cells_are_those_within_the_radius(grid_map, x, y, cells):
    center = grid_map.position + np.multiply((x, y), grid_map.length)
    radius = cells * grid_map.resolution
    assert circle_cells(grid_map, center, radius).tolist() == disc_by_hand(grid_map, center, radius)


def test_a_disc_holds_the_cells_exactly_on_its_rim():
    grid_map = GridMap((0.9, 0.9), 0.1)
    assert len(circle_cells(grid_map, (0, 0), 0.3)) == 29
    assert len(circle_cells(grid_map, (0, 0), 0.0)) == 1


def test_a_disc_beside_the_map_has_no_cells():
    grid_map = GridMap((1, 1), 0.1, layers=["elevation"])
    cells = circle_cells(grid_map, (3, 0), 1.0)
    assert cells.shape == (0, 2)
    grid_map["elevation"][tuple(cells.T)] = 1.0
    assert np.isnan(grid_map["elevation"]).all()


@given(grid_maps())
def test_cells_index_the_layers_directly(grid_map):
    seen = np.zeros(grid_map.size, dtype=int)
    seen[tuple(map_cells(grid_map).T)] += 1
    assert (seen == 1).all()
    whole = submap_cells(grid_map, grid_map.start_index, grid_map.size)
    np.testing.assert_array_equal(
        grid_map["elevation"][tuple(whole.T)], grid_map.unwrapped("elevation").ravel()
    )


def test_a_huge_disc_holds_the_entire_map():
    assert len(circle_cells(GridMap((1, 1), 0.1), (0, 0), 1e300)) == 100


@pytest.mark.parametrize("radius", [-0.1, np.nan, np.inf])
def test_a_disc_needs_a_finite_radius(radius):
    with pytest.raises(GeometryError, match="radius: expected a finite number >= 0"):
        circle_cells(GridMap((1, 1), 0.1), (0, 0), radius)


def test_a_block_beyond_the_map_is_an_error():
    grid_map = GridMap((4, 3), 1.0)
    grid_map.start_index = (2, 1)
    assert submap_cells(grid_map, (2, 1), (0, 3)).shape == (0, 2)
    with pytest.raises(GeometryError, match=r"\(4, 3\) cells at index \(3, 1\) is not within"):
        submap_cells(grid_map, (3, 1), (4, 3))
    with pytest.raises(GeometryError):
        submap_cells(grid_map, (2, 1), (-1, 1))
    with pytest.raises(OutOfMapError):
        submap_cells(grid_map, (4, 0), (1, 1))
