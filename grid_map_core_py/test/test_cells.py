# SPDX-License-Identifier: BSD-3-Clause
"""Region functions: cells and their order (contract 3)."""

import math
from functools import partial

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st

import golden
from grid_map_core_py import GeometryError, GridMap, OutOfMapError
from grid_map_core_py.regions import (
    Polygon,
    cells_to_mask,
    circle_cells,
    ellipse_cells,
    map_cells,
    polygon_cells,
    spiral_cells,
    submap_cells,
)
from grid_map_core_py.testing import grid_maps, moved_in_buffer

pairs = golden.pairs
by_map = golden.by_map("iterators")
golden_map = partial(golden.map_of, "iterators")
fractions = st.tuples(st.floats(-1, 1), st.floats(-1, 1))


def point(grid_map: GridMap, fraction: tuple[float, float]) -> np.ndarray:
    """A position on the map or within half a side of it."""
    return grid_map.position + np.multiply(fraction, grid_map.length)


def cells_by_hand(grid_map, contains):
    """Oracle: test each cell center, row by row from the map's corner."""
    world = np.moveaxis(np.indices(grid_map.size), 0, -1).reshape(-1, 2)
    indices = (world + grid_map.start_index) % grid_map.size
    centers = grid_map.get_positions(indices).tolist()
    return [i for i, p in zip(indices.tolist(), centers, strict=True) if contains(p)]


def disc_by_hand(grid_map, center, radius):
    return cells_by_hand(grid_map, lambda p: math.dist(p, center) <= radius + 1e-9)


def touches_a_center(grid_map, center, radius):
    distances = np.linalg.norm(grid_map.get_positions() - center, axis=1)
    return (np.abs(distances - radius) <= 1e-9).any()


# The whole map and blocks of it


@by_map
def test_cells_equal_cpp(name, case):
    """For shapes whose edges C++ does not decide by rounding."""
    grid_map = golden_map(name)
    assert pairs(map_cells(grid_map)) == case["grid_map"]["index"]
    shapes = {
        "submap": (submap_cells, ("submap_start_index", "submap_size")),
        "ellipse": (ellipse_cells, ("center", "length", "rotation")),
        "polygon": (polygon_cells, ("vertices",)),
    }
    assert [len(case[shape]) for shape in shapes] == [8, 120, 13]
    for shape, (cells, arguments) in shapes.items():
        for one in case[shape]:
            assert pairs(cells(grid_map, *map(one.get, arguments))) == one["index"]


@given(grid_maps())
def test_all_cells_come_once_in_buffer_or_map_order(grid_map):
    layer = grid_map["elevation"]
    np.testing.assert_array_equal(layer[map_cells(grid_map)], layer.ravel("F"))
    whole = submap_cells(grid_map, grid_map.start_index, grid_map.size)
    np.testing.assert_array_equal(layer[whole], grid_map.unwrapped("elevation").ravel())


@given(grid_maps(), st.tuples(*[st.integers(0, 30)] * 2), st.data())
def test_block_is_cut_off_at_the_border(grid_map, size, data):
    first = [data.draw(st.integers(0, cells - 1)) for cells in grid_map.size]
    world = moved_in_buffer(grid_map, (0, 0))
    seen = np.zeros(grid_map.size, dtype=bool)
    seen[first[0] : first[0] + size[0], first[1] : first[1] + size[1]] = True
    start_index = (np.add(first, grid_map.start_index) % grid_map.size).tolist()
    cells = submap_cells(grid_map, start_index, size)
    # Row by row in map order, like `np.argwhere`.
    in_world = (np.array(pairs(cells)).reshape(-1, 2) - grid_map.start_index) % grid_map.size
    np.testing.assert_array_equal(in_world, np.argwhere(seen))
    np.testing.assert_array_equal(grid_map["elevation"][cells], world["elevation"][seen])


def test_invalid_block_is_an_error():
    grid_map = GridMap((4, 3), 1.0)
    with pytest.raises(GeometryError, match=r"size: expected no negative numbers, got \(-1, 1\)"):
        submap_cells(grid_map, (2, 1), (-1, 1))
    with pytest.raises(OutOfMapError, match=r"index \(4, 0\) is outside"):
        submap_cells(grid_map, (4, 0), (1, 1))


# Discs


@by_map
def test_circle_cells_equal_cpp(name, case):
    """Except for edges that C++ rounds (contract 3: discs are closed within 1e-9 m)."""
    grid_map = golden_map(name)
    compared = 0
    for circle in case["circle"]:
        cells = pairs(circle_cells(grid_map, circle["center"], circle["radius"]))
        assert cells == disc_by_hand(grid_map, circle["center"], circle["radius"])
        if not touches_a_center(grid_map, circle["center"], circle["radius"]):
            assert cells == circle["index"]
            compared += 1
    assert compared >= 20


@given(grid_maps(), fractions, st.floats(0, 8))
def test_circle_cells_are_within_the_radius(grid_map, fraction, cells):
    center, radius = point(grid_map, fraction), cells * grid_map.resolution
    assert pairs(circle_cells(grid_map, center, radius)) == disc_by_hand(grid_map, center, radius)


def test_a_disc_holds_the_cells_exactly_on_its_rim():
    grid_map = GridMap((0.9, 0.9), 0.1)
    assert len(pairs(circle_cells(grid_map, (0, 0), 0.3))) == 29
    assert len(pairs(circle_cells(grid_map, (0, 0), 0.0))) == 1
    grid_map = GridMap((1, 1), 0.1)
    for shape in (circle_cells, spiral_cells):
        assert len(pairs(shape(grid_map, (0, 0), 1e300))) == 100
        assert len(pairs(shape(grid_map, (0, 0), 1.0))) == 100


# Spirals


@by_map
def test_spiral_cells_equal_cpp(name, case):
    """Select the cases where C++ is right: unmoved maps, inside its buffers, no cell on the edge.

    Contract 3: moved maps must work, and cells that exist in the disc must not be missed.
    """
    grid_map = golden_map(name)
    moved = grid_map.start_index != (0, 0)
    compared = 0
    for spiral in case["spiral"]:
        center, radius = spiral["center"], spiral["radius"]
        cells = pairs(spiral_cells(grid_map, center, radius))
        assert cells == spiral_by_hand(grid_map, center, radius)
        undefined = spiral["stopped_at_undefined_behaviour"]
        if not (moved or undefined or touches_a_center(grid_map, center, radius)):
            assert cells == spiral["index"]
            compared += 1
    assert compared >= (0 if moved else 50)


def spiral_by_hand(grid_map, center, radius):
    """Oracle: the disc and the center cell, sorted by ring, then clockwise up to the -x axis."""
    geometry, start, size = grid_map.geometry, grid_map.start_index, grid_map.size
    middle = np.floor((geometry.corner - center) / geometry.resolution + 1e-9).astype(int)
    cells = disc_by_hand(grid_map, center, radius)
    if grid_map.is_inside(center):
        index = list(grid_map.get_index(center))
        middle = (np.array(index) - start) % size
        cells = cells if index in cells else [*cells, index]

    def place(index):
        row, column = ((np.array(index) - start) % size - middle).tolist()
        clockwise = -math.degrees(math.atan2(-column, -row)) % 360
        return math.isqrt(row**2 + column**2), (clockwise - 180) % 360 or 360

    return sorted(cells, key=place)


@given(grid_maps(), fractions, st.floats(0, 8))
def test_spiral_cells_are_the_disc_sorted_from_the_inside_out(grid_map, fraction, cells):
    center, radius = point(grid_map, fraction), cells * grid_map.resolution
    steps = (grid_map.geometry.corner - center) / grid_map.resolution
    # Outside of the map, rounding decides the cell of a position on a cell border.
    assume(grid_map.is_inside(center) or (np.abs(steps - np.round(steps)) > 1e-6).all())
    found = pairs(spiral_cells(grid_map, center, radius))
    assert found == spiral_by_hand(grid_map, center, radius)


def test_large_spiral_begins_like_small_one():
    """A large spiral is sorted once; smaller ones are cut from the cached one."""
    grid_map = GridMap((30, 2), 0.1)
    few, many = (pairs(spiral_cells(grid_map, (0.0, 0.13), radius)) for radius in (12.0, 13.0))
    assert 4000 < len(few) < len(many) < 6000
    assert many[: len(few) - 100] == few[:-100]
    assert many == spiral_by_hand(grid_map, (0.0, 0.13), 13.0)


def test_spiral_beside_or_far_from_the_map_is_empty():
    for center in ((1e300, 0), (0, -1e300), (0, 50), (-50, 50), (13.2, 0)):
        assert pairs(spiral_cells(GridMap((1, 1), 0.1), center, 5.0)) == []


# Ellipses


@given(grid_maps(), fractions, st.tuples(st.floats(0.1, 16), st.floats(0.1, 16)), st.floats(-7, 7))
def test_ellipse_cells_are_inside_the_ellipse(grid_map, fraction, axes, rotation):
    """Oracle: turn the plane back as complex numbers, and scale the ellipse to the unit disc."""
    center, half_axes = point(grid_map, fraction), 0.5 * np.multiply(axes, grid_map.resolution)

    def value(position):
        turned = complex(*np.subtract(position, center)) * np.exp(-1j * rotation)
        return math.hypot(turned.real / half_axes[0], turned.imag / half_axes[1])

    assume(all(abs(value(position) - 1.0) > 1e-9 for position in grid_map.get_positions()))
    found = pairs(ellipse_cells(grid_map, center, 2 * half_axes, rotation))
    assert found == cells_by_hand(grid_map, lambda p: value(p) < 1.0)


def test_rotation_in_degrees_and_lines_as_polygons_warn():
    grid_map = GridMap((5, 5), 1.0)
    with pytest.warns(UserWarning, match=r"from -2 pi to 2 pi \[rad\], got 45. Convert degrees"):
        ellipse_cells(grid_map, (0, 0), (3.0, 1.0), 45)
    with pytest.warns(UserWarning, match=r"at least 3 vertices \[m\], got 2.*thicken_line"):
        assert pairs(polygon_cells(grid_map, [(0, 0), (2, 0)])) == []


def test_an_ellipse_without_area_has_no_cells():
    assert pairs(ellipse_cells(GridMap((5, 5), 1.0), (0, 0), (6.0, 0.0))) == []


# Polygons


lattice_points = st.tuples(st.integers(-12, 12), st.integers(-12, 12))


@given(grid_maps(), st.lists(fractions | lattice_points, min_size=3, max_size=9))
def test_polygon_cells_have_their_center_inside(grid_map, corners):
    """Vertices and edges often are exactly on centers of cells."""
    x, y = (axis[len(axis) // 2] for axis in grid_map.axes())
    polygon = Polygon(
        [
            (x, y) + np.multiply(corner, grid_map.resolution)
            if isinstance(corner[0], int)
            else point(grid_map, corner)
            for corner in corners
        ]
    )
    cells = polygon_cells(grid_map, polygon)
    assert pairs(cells) == cells_by_hand(grid_map, polygon.is_inside)


# Properties of all shapes


SHAPES = {
    "circle": lambda grid_map, center: circle_cells(grid_map, center, 0.4),
    "spiral": lambda grid_map, center: spiral_cells(grid_map, center, 0.4),
    "ellipse": lambda grid_map, center: ellipse_cells(grid_map, center, (0.9, 0.4), 0.3),
    "polygon": lambda grid_map, center: polygon_cells(
        grid_map, Polygon.from_circle(center, 0.4, 7)
    ),
}
each_shape = pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)


@each_shape
@given(grid_map=grid_maps(), fraction=fractions)
def test_mask_is_true_in_the_cells_only(shape, grid_map, fraction):
    cells = shape(grid_map, point(grid_map, fraction))
    assert all(n.dtype == np.int64 and n.flags.carray for n in cells)
    mask = cells_to_mask(grid_map, cells)
    assert np.argwhere(mask).tolist() == sorted(pairs(cells))
    np.testing.assert_array_equal(mask, cells_to_mask(grid_map, np.stack(cells, axis=-1)))


def test_cells_to_mask_refuses_cells_beyond_the_map():
    grid_map = GridMap((4, 3), 1.0)
    with pytest.raises(OutOfMapError, match=r"index \(4, 0\) is outside"):
        cells_to_mask(grid_map, (np.array([0, 4]), np.array([0, 0])))
    with pytest.raises(GeometryError, match="cells: expected a tuple"):
        cells_to_mask(grid_map, ([0, 1], [0]))
    with pytest.raises(GeometryError, match="cells: expected integers"):
        cells_to_mask(grid_map, np.zeros((4, 3), bool))


@each_shape
@pytest.mark.parametrize("center", [(np.nan, 0), (0, np.inf), (1, 2, 3), "ab", None])
def test_a_center_is_two_finite_numbers(shape, center):
    with pytest.raises(GeometryError):
        shape(GridMap((1, 1), 0.1), center)


@pytest.mark.parametrize(
    ("shape", "arguments", "message"),
    [
        *((circle_cells, (radius,), "radius: expected a") for radius in (-0.1, np.nan, "wide")),
        *((spiral_cells, (radius,), "radius: expected a") for radius in (-0.1, np.inf, "wide")),
        (ellipse_cells, ((1, -1),), "length: expected no negative"),
        (ellipse_cells, ((1, np.nan),), "length: expected two finite"),
        (ellipse_cells, ((1, 1), np.inf), "rotation: expected a finite angle"),
    ],
)
def test_sizes_of_shapes_are_finite_and_not_negative(shape, arguments, message):
    with pytest.raises(GeometryError, match=message):
        shape(GridMap((1, 1), 0.1), (0, 0), *arguments)
