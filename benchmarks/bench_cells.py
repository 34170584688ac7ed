# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of cell regions; like the C++ loops, each also reads every cell's value."""

import math

import numpy as np
import pytest
from terrain import RESOLUTION, terrain

from grid_map_core_py.regions import (
    Polygon,
    circle_cells,
    ellipse_cells,
    line_cells,
    map_cells,
    polygon_cells,
    spiral_cells,
    submap_cells,
)

DIAMETERS = pytest.mark.parametrize("diameter", [100, 200])
CENTER = (0.0, 0.0)


@pytest.fixture
def values(measure, cells):
    """Return a function that times reading the cells in a shape; it returns the map and values."""

    def run(row, shape, *arguments):
        grid_map = terrain(cells)

        def read():
            return grid_map["elevation"][shape(grid_map, *arguments)]

        return grid_map, measure(row, cells, read)

    return run


def centers(grid_map):
    """Return x (rows, 1) and y (cols,) of all cells."""
    x, y = grid_map.axes()
    return x[:, None], y


def test_sweep_over_all_cells(values):
    grid_map, found = values("GridMapIterator sweep map.at", map_cells)
    np.testing.assert_array_equal(found, grid_map["elevation"].ravel("F"))


@DIAMETERS
def test_submap(values, diameter):
    row = f"SubmapIterator DxD d={diameter}"
    grid_map, found = values(row, submap_cells, (0, 0), (diameter, diameter))
    np.testing.assert_array_equal(found, grid_map["elevation"][:diameter, :diameter].ravel())


def values_in_disc(grid_map, radius):
    x, y = centers(grid_map)
    return grid_map["elevation"][np.hypot(x, y) <= radius + 1e-9]


@DIAMETERS
def test_circle(values, diameter):
    radius = 0.5 * diameter * RESOLUTION
    grid_map, found = values(f"CircleIterator d={diameter}", circle_cells, CENTER, radius)
    np.testing.assert_array_equal(found, values_in_disc(grid_map, radius))


@DIAMETERS
def test_spiral(values, diameter):
    radius = 0.5 * diameter * RESOLUTION
    grid_map, found = values(f"SpiralIterator d={diameter}", spiral_cells, CENTER, radius)
    np.testing.assert_array_equal(np.sort(found), np.sort(values_in_disc(grid_map, radius)))


@DIAMETERS
def test_ellipse(values, diameter):
    length = np.multiply((1.0, 0.5), diameter * RESOLUTION)
    row = f"EllipseIterator D x D/2 rot 0.5 d={diameter}"
    grid_map, found = values(row, ellipse_cells, CENTER, length, 0.5)
    x, y = centers(grid_map)
    turned = (x + 1j * y) * np.exp(-0.5j) / (0.5 * length[0])
    inside = turned.real**2 + (2.0 * turned.imag) ** 2 <= 1.0
    np.testing.assert_array_equal(found, grid_map["elevation"][inside])


@DIAMETERS
def test_polygon(values, diameter):
    radius = 0.5 * diameter * RESOLUTION
    angles = np.arange(6) * math.pi / 3
    hexagon = Polygon(radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    grid_map, found = values(f"PolygonIterator hexagon d={diameter}", polygon_cells, hexagon)
    x, y = centers(grid_map)
    across = np.maximum(np.abs(y), np.abs(y) / 2 + np.abs(x) * math.sqrt(0.75))
    inside = across < math.sqrt(0.75) * radius
    np.testing.assert_array_equal(found, grid_map["elevation"][inside])


@DIAMETERS
def test_line(values, diameter):
    end = np.array([0.5, 0.25]) * diameter * RESOLUTION
    row = f"LineIterator (-R,-R/2)->(R,R/2) d={diameter}"
    grid_map, found = values(row, line_cells, -end, end)
    ends, _ = grid_map.get_indices(grid_map.geometry.closest_position([-end, end]))
    assert found.size == np.abs(np.diff(ends)).max() + 1
    np.testing.assert_array_equal(found[[0, -1]], grid_map["elevation"][ends])
