# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of the web viewer: scene data for the browser, and picking a point by click."""

import numpy as np
from terrain import terrain

from grid_map_visualization_py._viewer.scene import ViewSettings, hit, make_scene


def test_scene(measure, cells):
    grid_map, settings = terrain(cells), ViewSettings(height_layer="elevation")
    scene = measure("scene of the web viewer", cells, lambda: make_scene(grid_map, settings))
    vertices, faces = len(scene.mesh.vertices), len(scene.mesh.faces)
    assert vertices == np.isfinite(grid_map["elevation"]).sum()
    # Three floats and four 16-bit color channels per vertex, three indices per face.
    assert 0 < len(scene.glb) - 20 * vertices - 12 * faces < 2000


def test_hit(measure, cells):
    grid_map = terrain(cells)
    mesh = make_scene(grid_map, ViewSettings(height_layer="elevation")).mesh
    start, downwards = np.array([*grid_map.position, 100.0]), np.array([0.0, 0.0, -1.0])
    point = measure("click in the web viewer", cells, lambda: hit(mesh, start, downwards))
    np.testing.assert_allclose(point[:2], grid_map.position)
    near = grid_map.get_submap(grid_map.position, np.full(2, 2 * grid_map.resolution))
    heights = near["elevation"]
    assert np.nanmin(heights) - 1e-3 <= point[2] <= np.nanmax(heights) + 1e-3
