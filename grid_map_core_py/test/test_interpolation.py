# SPDX-License-Identifier: BSD-3-Clause
"""Values between cell centers."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

import golden
from grid_map_core_py import GridMap
from grid_map_core_py.errors import GeometryError, GridMapError, LayerNotFoundError, OutOfMapError
from grid_map_core_py.map import Interpolation
from grid_map_core_py.testing import grid_maps

NEAREST, LINEAR, CUBIC_CONVOLUTION, CUBIC = Interpolation
METHODS = list(Interpolation)
CASES = golden.cases("interpolation")
by_map = golden.by_map("interpolation")
by_method = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.value)


class Oracle:
    """One position at a time, in plain Python, from the definitions.

    Cells are counted in map order; `cell` and `value` repeat the border cell beyond the map.
    """

    def __init__(self, grid_map: GridMap, layer: str) -> None:
        self.grid_map = grid_map
        self.values = grid_map.unwrapped(layer).astype(float).tolist()
        self.axes = [axis.tolist() for axis in grid_map.geometry.axes_in_map_order()]

    def value(self, row, column):
        rows, columns = self.grid_map.size
        return self.values[min(max(row, 0), rows - 1)][min(max(column, 0), columns - 1)]

    def cell_at(self, position):
        index, start = self.grid_map.get_index(position), self.grid_map.start_index
        return tuple((i - s) % n for i, s, n in zip(index, start, self.grid_map.size, strict=True))

    def between(self, position, method):
        """Per axis, the number of the center below and the way t from there to the one above."""
        result = []
        for x, cell, axis in zip(position, self.cell_at(position), self.axes, strict=True):
            t = (x - axis[cell]) / self.grid_map.resolution
            # Bicubic squares include the borders that the squares of the other methods exclude.
            above = x > axis[cell] if method is CUBIC else x >= axis[cell]
            result.append((cell, t) if above else (cell + 1, t + 1.0))
        return result

    def stage(self, position, method):
        """Value of one method without fallback; not finite if a cell it uses is not finite."""
        if method is NEAREST:
            return self.value(*self.cell_at(position))
        weigh = {LINEAR: hat, CUBIC_CONVOLUTION: keys}.get(method)
        (row, s), (column, t) = self.between(position, method)
        if weigh is None:
            return self.hermite(row, s, column, t)
        steps = range(2) if method is LINEAR else range(-1, 3)
        return sum(
            self.value(row - i, column - j) * weigh(s - i) * weigh(t - j)
            for i in steps
            for j in steps
        )

    def hermite(self, row, s, column, t):
        rows, columns = self.grid_map.size
        total = 0.0
        for i in (0, 1):
            for j in (0, 1):
                corner = min(max(row - i, 0), rows - 1), min(max(column - j, 0), columns - 1)
                f, fx, fy, fxy = self.derivatives(*corner)
                total += f * rise(s, i) * rise(t, j) + fx * slope(s, i) * rise(t, j)
                total += fy * rise(s, i) * slope(t, j) + fxy * slope(s, i) * slope(t, j)
        return total

    def derivatives(self, row, column):
        """Value, slopes along +x and +y, and mixed derivative at a cell, per cell."""
        up, down, left, right = (row - 1, row + 1, column - 1, column + 1)
        return (
            self.value(row, column),
            (self.value(up, column) - self.value(down, column)) / 2,
            (self.value(row, left) - self.value(row, right)) / 2,
            (
                self.value(up, left)
                - self.value(up, right)
                - self.value(down, left)
                + self.value(down, right)
            )
            / 4,
        )

    def chain(self, position, method):
        """The first stage of the fallback that is finite, and its value."""
        stages = {LINEAR: [LINEAR], NEAREST: []}.get(method, [method, LINEAR])
        for stage in stages:
            value = self.stage(position, stage)
            if math.isfinite(value):
                return stage, value
        return NEAREST, self.stage(position, NEAREST)


def hat(distance):
    return 1.0 - abs(distance)


def keys(distance):
    """R. Keys, Cubic convolution interpolation for digital image processing, 1981, eq. 15."""
    s = abs(distance)
    if s < 1:
        return 1.5 * s**3 - 2.5 * s**2 + 1
    return -0.5 * s**3 + 2.5 * s**2 - 4 * s + 2 if s < 2 else 0.0


def rise(t, corner):
    return 3 * t**2 - 2 * t**3 if corner else 1 - 3 * t**2 + 2 * t**3


def slope(t, corner):
    return t**3 - t**2 if corner else t**3 - 2 * t**2 + t


def same(actual, expected, rtol):
    return math.isclose(actual, expected, rel_tol=rtol, abs_tol=rtol) or (
        math.isnan(actual) and math.isnan(expected)
    )


# The numbers of the C++ library


COMPARED = {NEAREST: 2793, LINEAR: 524, CUBIC_CONVOLUTION: 776, CUBIC: 971}


@by_method
def test_values_and_stages_equal_cpp_where_it_is_right(method):
    """Count the positions; C++ is wrong at the others, for one of these reasons.

    - A neighbor in the buffer is not the neighbor in the map: at the seam of a moved map. LINEAR
      also wraps over the ends of columns instead of repeating border cells, and refuses cells
      stored before the start index.
    - CUBIC_CONVOLUTION on the -x or -y side of the cell's center: evaluated next to its interval.
    - CUBIC in the half cell at the -x or -y border: t leaves [0, 1].
    - LINEAR with a neighbor that is not finite gives NaN and does not fall back.
    """
    compared = 0
    for name, case in CASES:
        grid_map, layer = golden.map_of("interpolation", name), case["layer"]
        results = case[method.value]
        oracle = Oracle(grid_map, layer)
        for position, value, stage in zip(
            case["position"], results["value"], results["method_used"], strict=True
        ):
            if grid_map.is_inside(position):
                found = grid_map.at_position(layer, position, method)
                used = oracle.chain(position, method)[0].value
                compared += used == stage and same(found, value, 1e-6)
    assert compared == COMPARED[method]


@by_map
@by_method
def test_all_golden_positions_inside_have_the_values_of_the_definitions(name, case, method):
    """Includes positions where C++ is wrong; the numbers of C++ are not used there."""
    grid_map, layer = golden.map_of("interpolation", name), case["layer"]
    oracle = Oracle(grid_map, layer)
    inside = [position for position in case["position"] if grid_map.is_inside(position)]
    assert len(inside) >= 270
    found = grid_map.at_position(layer, inside, method)
    for position, value in zip(inside, found, strict=True):
        assert same(value, oracle.chain(position, method)[1], 1e-9), position


@by_map
def test_golden_positions_outside_are_refused_by_every_method(name, case):
    """In C++ only the nearest value is; the other methods go on for half a cell beyond the map."""
    grid_map = golden.map_of("interpolation", name)
    outside = [value == "out_of_range" for value in case["nearest"]["value"]]
    assert sum(outside) >= 415
    np.testing.assert_array_equal(grid_map.is_inside(case["position"]), np.logical_not(outside))
    for position in np.compress(outside, case["position"], axis=0):
        for method in METHODS:
            with pytest.raises(OutOfMapError, match="is outside the map"):
                grid_map.at_position(case["layer"], position, method)


# Properties


@st.composite
def places(draw, maps=None):
    """A map and positions on it: anywhere, at and next to centers, cell borders and map borders."""
    grid_map = draw(grid_maps() if maps is None else maps)
    steps = st.sampled_from([-0.5, -0.25, -1e-12, 0.0, 1e-12, 0.25, 0.5]) | st.floats(-0.5, 0.5)
    positions = []
    for _ in range(draw(st.integers(1, 8))):
        index = [draw(st.integers(0, count - 1)) for count in grid_map.size]
        offset = np.array([draw(steps), draw(steps)]) * grid_map.resolution
        positions.append(grid_map.get_position(index) + offset)
    return grid_map, grid_map.get_closest_position_in_map(positions)


@by_method
@given(places())
def test_values_equal_the_definitions(method, drawn):
    grid_map, positions = drawn
    oracle = Oracle(grid_map, "elevation")
    found = grid_map.at_position("elevation", positions, method)
    expected = [oracle.chain(position, method)[1] for position in positions.tolist()]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-8)


@given(
    st.tuples(st.integers(1, 40), st.integers(1, 40)),
    st.sampled_from([0.01, 0.05, 0.1, 1 / 3, 1.0]),
    st.sampled_from([0.0, 0.5, 1.0, -0.5, 1 / 3, 123.4, 1e9]),
    st.integers(-3, 3),
)
def test_exactly_the_positions_on_the_map_have_values(size, resolution, center, ulps):
    grid_map = GridMap(np.multiply(size, resolution), resolution, (center, center), {"a": 1.0})
    half = 0.5 * grid_map.length
    for border in (center + half, center - half):
        for axis in (0, 1):
            position = np.full(2, center)
            position[axis] = border[axis] + ulps * np.spacing(center + half[axis])
            if grid_map.is_inside(position):
                values = [grid_map.at_position("a", position, method) for method in METHODS]
                np.testing.assert_allclose(values, 1.0, rtol=1e-12)
            else:
                with pytest.raises(OutOfMapError):
                    grid_map.at_position("a", position)


# Examples


def bumpy(cells: int = 30) -> GridMap:
    layer = np.random.default_rng(2).normal(size=(cells, cells + 1))
    return GridMap((cells, cells + 1), 1.0, layers={"a": layer})


@by_method
def test_values_do_not_depend_on_the_number_of_positions(method):
    grid_map = bumpy()
    positions = np.random.default_rng(3).uniform(-14, 14, (20_000, 2))
    groups = [grid_map.at_position("a", group, method) for group in np.split(positions, 40)]
    found = grid_map.at_position("a", positions, method)
    np.testing.assert_allclose(found, np.concatenate(groups), rtol=0, atol=1e-12)


@by_method
def test_one_position_gives_float_and_many_give_float64_array(method):
    grid_map = bumpy()
    one = grid_map.at_position("a", (0.2, 0.3), method)
    assert type(one) is float
    assert grid_map.at_position("a", (0.2, 0.3), method.value) == one
    if method is NEAREST:
        assert grid_map.at_position("a", (0.2, 0.3)) == one
    for positions in ([(0.2, 0.3)], np.zeros((3, 2), int), np.zeros((0, 2))):
        values = grid_map.at_position("a", positions, method)
        assert values.dtype == np.float64
        assert values.shape == (len(positions),)


@by_method
@pytest.mark.parametrize("position", [(-2.5, 0.0), (1e300, 0.0), (0.0, np.nan), (np.inf, 0.0)])
def test_the_first_position_outside_the_map_is_named(method, position):
    grid_map = GridMap((5, 5), 1.0, layers={"a": 1.0})
    many = np.vstack([np.zeros((10_000, 2)), position, [(-7.0, 7.0)]])
    x, y = map(str, np.array(position).tolist())
    with pytest.raises(OutOfMapError) as error:
        grid_map.at_position("a", many, method)
    assert f"position ({x}, {y}) is outside the map: center (0.0, 0.0)" in str(error.value)


@pytest.mark.parametrize("positions", [1.0, [1.0, 2.0, 3.0], [[1.0], [2.0]], "here", []])
def test_positions_of_a_wrong_shape_are_refused(positions):
    with pytest.raises(GeometryError, match="position: expected"):
        bumpy().at_position("a", positions, LINEAR)


@pytest.mark.parametrize("method", ["spline", 1, None])
def test_unknown_layers_and_methods_are_refused(method):
    with pytest.raises(LayerNotFoundError, match="no layer 'b'; available: a"):
        bumpy().at_position("b", (0, 0))
    known = "expected one of nearest, linear, cubic_convolution, cubic, got"
    with pytest.raises(GridMapError, match=f"interpolation: {known} {method!r}"):
        bumpy().at_position("a", (0, 0), method)
