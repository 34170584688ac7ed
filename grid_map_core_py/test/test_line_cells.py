# SPDX-License-Identifier: BSD-3-Clause
"""Lines of cells, between positions and between indices."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError, GridMap, OutOfMapError
from grid_map_core_py.regions import line_cells, line_cells_between
from grid_map_core_py.testing import grid_maps

pairs = golden.pairs
by_map = golden.by_map("iterators")
golden_map = partial(golden.map_of, "iterators")
fractions = st.tuples(st.floats(-1, 1), st.floats(-1, 1))


@by_map
def test_line_cells_between_indices_equal_cpp(name, case):
    assert len(case["line_indices"]) == 10
    for line in case["line_indices"]:
        cells = line_cells_between(golden_map(name), line["start"], line["end"])
        assert pairs(cells) == line["index"]


@by_map
def test_line_cells_equal_cpp(name, case):
    """Compare all golden lines, except some with an end outside of the map.

    C++ walks in from there in steps of a cell, so that it may begin a cell further inside or miss
    the map (contract 3: a segment that starts or ends outside is clipped exactly to the map).
    """
    grid_map = golden_map(name)
    equal = 0
    for line in case["line_positions"]:
        start, end = line["start"], line["end"]
        first, last = first_on_map(grid_map, start, end), first_on_map(grid_map, end, start)
        if first is None:
            assert not line["ok"]
            with pytest.raises(OutOfMapError, match="does not touch the map"):
                line_cells(grid_map, start, end)
            equal += 1
        elif (cells := pairs(line_cells(grid_map, start, end))) == line.get("index"):
            equal += 1
        else:
            assert not grid_map.is_inside([start, end]).all()
            assert cells == pairs(line_cells_between(grid_map, first, last))
    assert len(case["line_positions"]) == 21
    assert equal >= 16


def first_on_map(grid_map, start, end):
    """Oracle: the index where a line from start to end enters the map, by trial and bisection."""

    def at(fraction):
        return (1 - fraction) * np.asarray(start) + fraction * np.asarray(end)

    tried = np.linspace(0, 1, 20001)
    inside = np.flatnonzero(grid_map.is_inside(at(tried[:, None])))
    if not inside.size:
        return None
    after, before = tried[inside[0]], tried[max(inside[0] - 1, 0)]
    for _ in range(60):
        middle = 0.5 * (before + after)
        before, after = (before, middle) if grid_map.is_inside(at(middle)) else (middle, after)
    return grid_map.get_index(at(after))


@given(grid_maps(), st.data())
def test_a_line_between_cells_is_connected_straight_and_complete(grid_map, data):
    ends = st.tuples(*(st.integers(0, side - 1) for side in grid_map.size))
    start, end = data.draw(ends), data.draw(ends)
    cells = line_cells_between(grid_map, start, end)
    assert tuple(pairs(cells)[0]) == start
    assert tuple(pairs(cells)[-1]) == end
    centers = grid_map.get_positions(cells) / grid_map.resolution
    steps = np.abs(np.diff(centers, axis=0))
    if start != end:
        # One cell per step along the longer axis, at most half a cell beside the line.
        along = np.abs(centers[-1] - centers[0])
        np.testing.assert_allclose(steps[:, along.argmax()], 1.0)
        assert (steps < 1.001).all()
        straight = np.linspace(centers[0], centers[-1], len(centers))
        assert np.abs(centers - straight).max() < 0.501


@given(grid_maps(), fractions, fractions)
def test_a_line_is_clipped_to_the_map(grid_map, start, end):
    """Its ends are where it enters and leaves the map, each up to the rounding of one position."""
    ends = grid_map.position + np.multiply([start, end], grid_map.length)
    try:
        cells = line_cells(grid_map, *ends)
    except OutOfMapError:
        tried = np.linspace(*ends, 1001)
        depth = 0.5 * grid_map.length - np.abs(tried - grid_map.position)
        assert (depth.min(axis=1) < 1e-9).all()
        return
    expected = first_on_map(grid_map, *ends), first_on_map(grid_map, *ends[::-1])
    if None in expected:
        assert len(pairs(cells)) <= 2
        return
    for found, index in zip((pairs(cells)[0], pairs(cells)[-1]), expected, strict=True):
        off = grid_map.get_position(found) - grid_map.get_position(index)
        assert np.abs(off).max() <= 1.001 * grid_map.resolution


def test_a_line_right_across_the_map_is_exactly_clipped():
    grid_map = GridMap((4, 4), 1.0)
    assert pairs(line_cells(grid_map, (3, 3), (-3, -3))) == [[0, 0], [1, 1], [2, 2], [3, 3]]
    assert line_cells(grid_map, (1e9, 0.5), (-1e9, 0.5))[0].tolist() == [0, 1, 2, 3]
    # A line may be one cell.
    assert pairs(line_cells(grid_map, (0.5, 0.5), (0.5, 0.5))) == [[1, 1]]
    assert pairs(line_cells_between(grid_map, [1, 1], np.array([1, 1]))) == [[1, 1]]


def test_line_along_border_belongs_to_map_as_positions_do():
    grid_map = GridMap((4, 4), 1.0)
    along_the_far_side = line_cells(grid_map, (2, 3), (2, -3))
    assert pairs(along_the_far_side) == [[0, 0], [0, 1], [0, 2], [0, 3]]
    with pytest.raises(OutOfMapError):
        line_cells(grid_map, (-2, 3), (-2, -3))
    with pytest.raises(OutOfMapError):
        line_cells(grid_map, (-2, 0), (-3, 0))
    assert pairs(line_cells(grid_map, (-2, 0.5), (-1.5, 0.5))) == [[3, 1]]


def test_the_ends_of_a_line_must_be_numbers_and_cells():
    grid_map = GridMap((4, 4), 1.0)
    with pytest.raises(GeometryError, match="start: expected two finite numbers"):
        line_cells(grid_map, (np.nan, 0), (0, 0))
    with pytest.raises(GeometryError, match="end_index: expected"):
        line_cells_between(grid_map, (0, 0), (0.5, 1.5))
    with pytest.raises(OutOfMapError, match=r"\(0, 4\)"):
        line_cells_between(grid_map, (0, 0), (0, 4))


def test_line_with_tiny_slope_is_drawn():
    grid_map = GridMap((4, 4), 1.0)
    assert pairs(line_cells(grid_map, (0.5, 0.5), (0.5 + 1e-300, 5e-324))) == [[1, 1], [1, 2]]
    assert pairs(line_cells(grid_map, (1e-310, 0.5), (0, 0.5))) == [[2, 1]]
    with pytest.raises(OutOfMapError):
        line_cells(grid_map, (3, 0.0), (3, 5e-324))


@pytest.mark.parametrize("end", [(0.0, 0.0), (-0.024999999999999988, 5.0), (-0.02, -5.0)])
def test_line_begins_at_end_that_rounding_puts_on_map(end):
    grid_map = GridMap((0.15, 0.05), 0.05, (-0.1, 0.0))
    start = -0.024999999999999988, 0.0
    assert start[0] > grid_map.geometry.corner[0]
    assert grid_map.is_inside(start)
    assert pairs(line_cells(grid_map, start, end))[0] == [0, 0]
    assert pairs(line_cells(grid_map, end, start))[-1] == [0, 0]
