# SPDX-License-Identifier: BSD-3-Clause
"""Calls for one cell or one position give the bits and the errors of calls for many."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from grid_map_core_py import GridGeometry, GridMap, GridMapError, Interpolation, OutOfMapError
from grid_map_core_py.testing import grid_maps

ODD_NUMBERS = [np.nan, np.inf, -np.inf, 1e308, -1e308, 0.0, -0.0, 5e-324]


@st.composite
def maps(draw):
    """Maps of all kinds, some of them far from the origin, where borders round."""
    grid_map = draw(grid_maps(layers=("elevation", "n_x", "n_y", "n_z"), max_side=7))
    centers = st.sampled_from([0.0, 0.5, -1 / 3, 123.4, 1e9, -7.3e15]) | st.floats(-50, 50)
    grid_map.position = draw(centers), draw(centers)
    return grid_map


@st.composite
def maps_and_positions(draw):
    """A map and a position anywhere, on or beside borders, centers and lines between cells."""
    grid_map = draw(maps())
    ulps, position = st.integers(-2, 2), []
    for center, length in zip(grid_map.position, grid_map.length, strict=True):
        half_cells = round(2 * length / grid_map.resolution)
        steps = st.integers(-half_cells - 1, half_cells + 1) | st.floats(-half_cells, half_cells)
        place = center + 0.25 * grid_map.resolution * draw(steps)
        place += draw(ulps) * np.spacing(abs(center) + length)
        position.append(draw(st.just(float(place)) | st.sampled_from(ODD_NUMBERS)))
    return grid_map, tuple(position)


@st.composite
def maps_and_cells(draw):
    grid_map = draw(maps())
    return grid_map, tuple(draw(st.integers(-1, count)) for count in grid_map.size)


def outcome(call, *arguments):
    """Return the type and the bits of what a call returns, or its error."""
    try:
        result = call(*arguments)
    except GridMapError as error:
        return type(error), str(error)
    if isinstance(result, tuple):
        return tuple, result, [type(number) for number in result]
    # As bits: -0.0 differs from 0.0, and NaN equals NaN.
    return type(result), np.asarray(result).dtype, np.asarray(result).tobytes()


def first_value(grid_map, *arguments):
    return float(grid_map.at_position(*arguments)[0])


def forms_of(pair):
    return [pair, list(pair), np.array(pair), np.array([pair])[0], tuple(np.array(pair))]


@given(maps_and_positions())
def test_one_position_has_the_cell_found_among_many(drawn):
    grid_map, position = drawn
    (rows, columns), inside = grid_map.get_indices([position])
    for form in forms_of(position):
        assert outcome(grid_map.is_inside, form) == (bool, np.bool_, inside.tobytes())
        if inside[0]:
            assert grid_map.get_index(form) == (rows[0], columns[0])
            assert [type(number) for number in grid_map.get_index(form)] == [int, int]
        else:
            geometry = grid_map.geometry
            message = f"position {position} is outside the map: {geometry.place}"
            assert outcome(grid_map.get_index, form) == (OutOfMapError, message)


@pytest.mark.parametrize("method", Interpolation)
@given(maps_and_positions())
def test_one_position_has_the_value_found_among_many(method, drawn):
    grid_map, position = drawn
    for count in (1, 3):
        many = "elevation", [position] * count, method
        expected = outcome(first_value, grid_map, *many)
        for form in forms_of(position):
            assert outcome(grid_map.at_position, "elevation", form, method) == expected


@given(maps_and_cells())
def test_one_cell_has_the_position_and_value_found_among_many(drawn):
    grid_map, cell = drawn
    center = outcome(lambda: grid_map.get_positions([cell])[0])
    valid = outcome(lambda: bool(grid_map.is_valid([cell])[0]))
    both_valid = outcome(lambda: bool(grid_map.is_valid([cell], ["n_x", "n_y"])[0]))
    for form in forms_of(cell):
        assert outcome(grid_map.get_position, form) == center
        assert outcome(grid_map.is_valid, form) == valid
        assert outcome(grid_map.is_valid, form, ["n_x", "n_y"]) == both_valid
        assert outcome(grid_map.get_vector, "n_", form) == outcome(vector, grid_map, cell)
        assert outcome(grid_map.get_position3, "n_z", form) == outcome(point, grid_map, cell)


def vector(grid_map, cell):
    grid_map.get_positions([cell])
    values = np.array([grid_map[f"n_{axis}"][cell] for axis in "xyz"], np.float64)
    return values if np.isfinite(values).all() else np.full(3, np.nan)


def point(grid_map, cell):
    values = np.append(grid_map.get_positions([cell])[0], grid_map["n_z"][cell])
    return values if np.isfinite(values).all() else np.full(3, np.nan)


@given(maps(), st.tuples(st.integers(-40, 40), st.integers(-40, 40)))
def test_moved_geometry_equals_one_made_at_its_place(grid_map, shift):
    geometry = grid_map.geometry.shifted(shift)
    made = GridGeometry(geometry.length, geometry.resolution, geometry.position)
    assert geometry == made
    for one, other in zip(geometry.axes_in_map_order(), made.axes_in_map_order(), strict=True):
        np.testing.assert_array_equal(one, other)


PAIRS = [
    *((True, False), (1.0, 2.0), (2**62, 1), (2**53 + 1, 0), (np.int32(1), 2), (np.float32(1), 2)),
    *(
        np.array([1, 2], np.uint8),
        np.array([0.1, 0.2], np.float32),
        np.ma.array([1, 2], mask=[1, 0]),
    ),
    *(("0.1", "0.2"), (None, 1), (1.0, 2.0 + 1j), (1, 2, 3), None),
]


@pytest.mark.parametrize("pair", PAIRS, ids=repr)
def test_unusual_pairs_are_taken_as_in_arrays(pair):
    grid_map = GridMap((4.0, 6.0), 0.5, layers={"elevation": 1.0}, basic_layers=["elevation"])
    geometry = grid_map.geometry
    assert outcome(grid_map.is_inside, pair) == outcome(lambda: bool(geometry.is_inside(pair)))

    def as_arrays():
        return bool(np.isfinite(grid_map["elevation"][geometry.check_indices(pair)]))

    assert outcome(grid_map.is_valid, pair) == outcome(as_arrays)
