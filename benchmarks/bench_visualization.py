# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of visualizations, from a map to serialized messages or viewer arrays."""

import numpy as np
from rclpy.serialization import deserialize_message
from terrain import terrain
from visualization_msgs.msg import Marker

from grid_map_visualization_py._builtin._contours import ContoursVisualization
from grid_map_visualization_py._builtin._image import ImageVisualization
from grid_map_visualization_py._builtin._surface import SurfaceVisualization
from grid_map_visualization_py._builtin._vectors import VectorsVisualization
from grid_map_visualization_py.colors import Coloring
from grid_map_visualization_py.surface import Surface as Triangles

BYTES_PER_CORNER = 3 * 8 + 4 * 4


def triangle_count(heights):
    """Return the number of triangles: 1 or 2 per 2 x 2 block with 3 or 4 finite heights."""
    known = np.isfinite(heights).astype(int)
    counts = known[:-1, :-1] + known[1:, :-1] + known[:-1, 1:] + known[1:, 1:]
    return np.count_nonzero(counts == 3) + 2 * np.count_nonzero(counts == 4)


def test_surface(measure, cells):
    show, grid_map = SurfaceVisualization(), terrain(cells)
    data = measure("surface, map to bytes", cells, lambda: show(grid_map))
    corners = 3 * triangle_count(grid_map["elevation"])
    assert 0 < len(data) - BYTES_PER_CORNER * corners < 400


def test_mesh(measure, cells):
    grid_map = terrain(cells)
    row = "mesh of the viewer"
    mesh = measure(row, cells, lambda: Triangles(grid_map, "elevation").mesh(Coloring()))
    assert len(mesh.faces) == triangle_count(grid_map["elevation"])
    assert len(mesh.vertices) == len(mesh.colors) == np.isfinite(grid_map["elevation"]).sum()


def test_vectors(measure, cells):
    show = VectorsVisualization(layer_prefix="normal_vectors_", position_layer="elevation")
    grid_map = terrain(cells, layers=4)
    data = measure("vectors, map to bytes", cells, lambda: show(grid_map))
    lines = np.isfinite([grid_map[f"normal_vectors_{axis}"] for axis in "xyz"]).all(axis=0)
    lines &= np.isfinite(grid_map["elevation"])
    assert 0 < len(data) - 2 * BYTES_PER_CORNER * lines.sum() < 400


def test_contours(measure, cells):
    show, grid_map = ContoursVisualization(layer="elevation", interval=0.1), terrain(cells)
    data = measure("contours every 0.1", cells, lambda: show(grid_map))
    heights = np.array([point.z for point in deserialize_message(data, Marker).points])
    np.testing.assert_allclose(np.unique(heights), np.arange(-3, 4) * 0.1, atol=1e-12)


def test_image(measure, cells):
    show, grid_map = ImageVisualization(layer="elevation"), terrain(cells)
    image = measure("image by a color map", cells, lambda: show(grid_map))
    assert (image.height, image.width, len(image.data)) == (cells, cells, 3 * cells**2)
