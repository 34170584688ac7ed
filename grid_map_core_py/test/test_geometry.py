# SPDX-License-Identifier: BSD-3-Clause
"""Positions, cells and boxes of cells."""

import copy
import math
import pickle
from functools import partial

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GeometryError, GridGeometry, OutOfMapError
from grid_map_core_py.testing import assert_maps_equal

CASES = golden.cases("geometry")
by_map = golden.by_map("geometry")
golden_map = partial(golden.map_of, "geometry")
coordinates = st.floats(-1e3, 1e3)
geometries = st.builds(
    GridGeometry.from_size,
    st.tuples(st.integers(1, 60), st.integers(1, 60)),
    st.sampled_from([0.01, 0.03, 0.05, 0.1, 1 / 3, 1.0]),
    st.tuples(coordinates, coordinates),
)


@by_map
def test_positions_fall_into_the_cells_that_cpp_finds(name, case):
    queries = case["pos_to_index"]
    cells, inside = golden_map(name).get_indices(queries["position"])
    np.testing.assert_array_equal(inside, queries["inside"])
    expected = np.array([index or (-1, -1) for index in queries["index"]])
    np.testing.assert_array_equal(np.array(golden.pairs(cells))[inside], expected[inside])


@by_map
def test_closest_positions_equal_cpp_but_are_always_inside(name, case):
    grid_map = golden_map(name)
    queries = case["pos_to_index"]
    closest = grid_map.get_closest_position_in_map(queries["position"])
    np.testing.assert_allclose(closest, queries["closest"], rtol=0, atol=1e-12)
    assert grid_map.is_inside(closest).all()


@by_map
def test_indices_have_the_positions_that_cpp_gives_them(name, case):
    grid_map = golden_map(name)
    queries = case["index_to_pos"]
    for index, ok, position in zip(
        queries["index"], queries["ok"], queries["position"], strict=True
    ):
        if ok:
            np.testing.assert_allclose(grid_map.get_position(index), position, rtol=0, atol=1e-12)
        else:
            with pytest.raises(OutOfMapError, match="outside the map"):
                grid_map.get_position(index)


def has_edge_on_border(grid_map, request):
    """Return True if an edge of a request is within 1e-9 m of a border between cells.

    C++ may take one more cell there (contract 1: "takes no further cell").
    """
    edges = request["position"] + np.outer((-0.5, 0.5), request["length"])
    steps = (grid_map.geometry.corner - edges) / grid_map.resolution
    between = (steps > 0.5) & (steps < np.subtract(grid_map.size, 0.5))
    return (between & (abs(steps - steps.round()) * grid_map.resolution < 1e-9)).any()


@by_map
def test_submaps_equal_cpp(name, case):
    grid_map = golden_map(name)
    compared = 0
    for request in case["submap"]:
        if not request["ok"] or has_edge_on_border(grid_map, request):
            continue
        submap = grid_map.get_submap(request["position"], request["length"])
        assert submap.size == tuple(request["size"])
        np.testing.assert_allclose(submap.position, request["submap_position"], atol=1e-12)
        assert grid_map.get_index(submap.get_position((0, 0))) == tuple(request["start_index"])
        if grid_map.is_inside(request["position"]):
            found = submap.get_index(request["position"])
            assert found == tuple(request["requested_index_in_submap"])
        if request.get("submap"):
            assert_maps_equal(submap, golden.to_map(request["submap"]))
        compared += 1
    assert compared >= 15


@by_map
def test_a_submap_whose_center_leaves_the_map_covers_the_overlap(name, case):
    """C++ refuses these requests (contract 1: every cell that the clamped rectangle overlaps)."""
    grid_map = golden_map(name)
    refused = [request for request in case["submap"] if not request["ok"]]
    assert refused
    for request in refused:
        expected = overlapped_cells(grid_map, request["position"], request["length"])
        if not expected:
            with pytest.raises(OutOfMapError, match="does not overlap"):
                grid_map.get_submap(request["position"], request["length"])
            continue
        submap = grid_map.get_submap(request["position"], request["length"])
        assert sorted(map(tuple, np.round(submap.get_positions(), 9))) == expected


def test_an_edge_on_a_cell_border_takes_no_further_cell():
    compared = 0
    for name, case in CASES:
        grid_map = golden_map(name)
        for request in case["submap"]:
            if request["ok"] and has_edge_on_border(grid_map, request):
                submap = grid_map.get_submap(request["position"], request["length"])
                expected = overlapped_cells(grid_map, request["position"], request["length"])
                assert sorted(map(tuple, np.round(submap.get_positions(), 9))) == expected
                compared += 1
    assert compared >= 3


def overlapped_cells(grid_map, position, length):
    """Oracle: test for every cell whether it overlaps the rectangle by more than 1e-9 m."""
    half = 0.5 * grid_map.resolution
    cells = []
    for center in grid_map.get_positions():
        reach = np.minimum(center + half, np.add(position, np.multiply(0.5, length))) - np.maximum(
            center - half, np.subtract(position, np.multiply(0.5, length))
        )
        if (reach > 1e-9).all():
            cells.append(tuple(np.round(center, 9)))
    return sorted(cells)


@pytest.mark.parametrize("case", golden.load("geometry")["index_shift"])
def test_shifts_round_as_in_cpp(case):
    geometry = GridGeometry.from_size((10, 10), case["resolution"])
    shift = geometry.index_shift(case["position_shift"])
    assert shift == tuple(case["index_shift"])
    np.testing.assert_allclose(
        geometry.shifted(shift).position, case["position_shift_back"], atol=1e-12
    )


def test_an_index_is_in_range_where_cpp_leaves_the_buffer():
    cases = golden.load("geometry")["ok_but_index_out_of_range"]
    assert cases
    for case in cases:
        geometry = GridGeometry(case["length"], case["resolution"], case["map_position"])
        (row, column), _ = geometry.cells_at(case["position"])
        assert 0 <= row < geometry.size[0]
        assert 0 <= column < geometry.size[1]


@given(geometries, st.tuples(coordinates, coordinates))
def test_closest_position_is_inside_and_no_other_is_closer(geometry, position):
    closest = geometry.closest_position(position)
    assert geometry.is_inside(closest)
    if geometry.is_inside(position):
        assert tuple(closest) == position
    distance = math.dist(closest, position)
    corners = geometry.centers([[0, 0], np.subtract(geometry.size, 1)])
    assert all(distance <= math.dist(corner, position) + 1e-9 for corner in corners)


@pytest.mark.parametrize("center", [0.5, -0.5, 1.0, 1 / 3, 1e-300, 1e9, -7.3e15])
@pytest.mark.parametrize("resolution", [0.1, 1.0, 1 / 3])
def test_closest_positions_exist_for_borders_at_zero_or_far_away(center, resolution):
    geometry = GridGeometry.from_size((1, 3), resolution, (center, center))
    for direction in ((-1e300, -1e300), (1e300, 1e300), (-1e300, 1e300)):
        assert geometry.is_inside(geometry.closest_position(direction))


def test_lengths_are_rounded_to_whole_cells_half_away_from_zero():
    geometry = GridGeometry((1.25, 1.2), 0.5)
    assert geometry.size == (3, 2)
    assert geometry.length.tolist() == [1.5, 1.0]


def test_equal_geometries_are_equal_and_hash_alike():
    one, two = GridGeometry((1, 2), 0.1, (3, 4)), GridGeometry((1.01, 2), 0.1, (3, 4))
    assert one == two
    assert hash(one) == hash(two)
    assert one != one.at((3, 5))


@pytest.mark.parametrize(
    "duplicate", [copy.copy, copy.deepcopy, lambda g: pickle.loads(pickle.dumps(g))]
)
def test_a_geometry_cannot_be_changed(duplicate):
    geometry = duplicate(GridGeometry((1, 1), 0.1))
    assert geometry == GridGeometry((1, 1), 0.1)
    with pytest.raises(ValueError, match="read-only"):
        geometry.position[0] = 1.0
    with pytest.raises(AttributeError):
        geometry.resolution = 0.2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((1, 1), 0.0), "resolution: expected a positive number, got 0.0"),
        (((1, 1), np.nan), "resolution: expected a positive number, got nan"),
        (((5e-324, 5e-324), 5e-324), "resolution: expected a positive number, got 5e-324"),
        (((1, 1), np.inf), "resolution: expected a positive number, got inf"),
        (((0, 1), 0.1), "length: expected positive numbers"),
        (((np.inf, 1), 0.1), "length: expected two finite numbers"),
        (((1, 1, 1), 0.1), "length: expected two finite numbers"),
        (((0.04, 1), 0.1), "length: expected at least half a cell"),
        (((1, 1), 0.1, (np.nan, 0)), "position: expected two finite numbers"),
        (((1, 1), 0.1, "here"), "position: expected numbers"),
        (((1, 1), "fine"), "resolution: expected a number, got 'fine'"),
        (((1, 1), 10**400), "resolution: expected a number, got 1000"),
        (((1 + 2j, 1), 0.1), "length: expected numbers"),
        (((1e300, 1), 1e-300), r"length: expected at most 2\*\*31 cells"),
        (((1e12, 1), 0.1), r"length: expected at most 2\*\*31 cells"),
    ],
)
def test_invalid_grid_is_refused(arguments, message):
    with pytest.raises(GeometryError, match=message):
        GridGeometry(*arguments)
    with pytest.raises(GeometryError, match="length: expected positive numbers"):
        GridGeometry.from_size((2, 0), 0.1)
    with pytest.raises(GeometryError, match="size: expected integers"):
        GridGeometry.from_size((2.5, 3), 0.1)


@pytest.mark.parametrize("positions", [1.0, [1.0, 2.0, 3.0], [[1.0], [2.0]]])
def test_positions_of_a_wrong_shape_are_refused(positions):
    with pytest.raises(GeometryError, match="expected x, y of shape"):
        GridGeometry((1, 1), 0.1).is_inside(positions)
    with pytest.raises(GeometryError, match="NaN has no closest position"):
        GridGeometry((1, 1), 0.1).closest_position((np.nan, 0))
