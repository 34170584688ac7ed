# SPDX-License-Identifier: BSD-3-Clause
"""Vectors against a loop over the cells, the outline of a map, and its point clouds."""

import numpy as np
from hypothesis import given, settings, strategies as st
from messages import drawn, fields_of, points_of

from grid_map_core_py import GridMap, map_cells
from grid_map_core_py.testing import grid_maps

LAYERS = ("height", "normal_x", "normal_y", "normal_z")
VECTORS = {"layer_prefix": "normal_", "position_layer": "height"}


def lines_by_loop(grid_map: GridMap, scale: float) -> list[list[float]]:
    points = []
    for cell in zip(*map_cells(grid_map), strict=True):
        start = grid_map.get_position3("height", cell)
        vector = grid_map.get_vector("normal_", cell)
        if np.isfinite([start, vector]).all():
            points += [start.tolist(), (start + scale * vector).tolist()]
    return points


@settings(max_examples=60)
@given(grid_maps(LAYERS, max_side=6), st.sampled_from([0.06, 1.0, -2.5]))
def test_valid_cells_get_vectors_in_buffer_order(grid_map, scale):
    marker = drawn("vectors", grid_map, scale=scale, **VECTORS)
    assert points_of(marker).tolist() == lines_by_loop(grid_map, scale)
    assert len(marker.colors) == len(marker.points)


def test_basic_layers_do_not_matter_for_vectors():
    grid_map = GridMap((2, 1), 1.0, layers=dict.fromkeys(LAYERS, 1.0) | {"color": np.nan})
    grid_map.basic_layers = ["color"]
    assert len(drawn("vectors", grid_map, **VECTORS).points) == 4


@settings(max_examples=60)
@given(grid_maps())
def test_region_runs_once_around_the_map_and_closes(grid_map):
    points = points_of(drawn("map_region", grid_map))
    assert points.shape == (5, 3)
    assert (points[0] == points[4]).all()
    assert (points[:, 2] == 0).all()
    np.testing.assert_allclose(points[:4].max(axis=0)[:2], grid_map.geometry.corner, rtol=1e-6)
    np.testing.assert_allclose(points[:4].mean(axis=0)[:2], grid_map.position, atol=1e-9)
    # Each side changes one coordinate only.
    assert (np.count_nonzero(np.diff(points, axis=0), axis=1) == 1).all()


def test_map_without_layers_has_a_region_of_the_given_width():
    marker = drawn("map_region", GridMap((2, 1), 0.5), line_width=0.1)
    assert (len(marker.points), marker.scale.x) == (5, 0.1)


def test_flat_point_cloud_needs_no_heights():
    grid_map = GridMap((3, 1), 1.0, layers={"elevation": [[1.0], [np.nan], [3.0]]})
    cloud = drawn("point_cloud", grid_map, layer="missing", flat=True)
    assert fields_of(cloud, *"xyz").tolist() == [[1, 0, 0], [0, 0, 0], [-1, 0, 0]]
