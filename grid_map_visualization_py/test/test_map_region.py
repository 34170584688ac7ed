# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The outline of a map."""

import numpy as np
from hypothesis import given, settings
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.testing import grid_maps
from grid_map_visualization_py.builtin._map_region import MapRegionVisualization


def drawn(grid_map: GridMap, **parameters: object) -> Marker:
    return deserialize_message(MapRegionVisualization(**parameters)(grid_map), Marker)


@settings(max_examples=60)
@given(grid_maps())
def test_line_runs_once_around_the_map_and_closes(grid_map):
    points = np.array([(p.x, p.y, p.z) for p in drawn(grid_map).points])
    assert points.shape == (5, 3)
    assert (points[0] == points[4]).all()
    assert (points[:, 2] == 0).all()
    np.testing.assert_allclose(points[:4].max(axis=0)[:2], grid_map.geometry.corner, rtol=1e-6)
    np.testing.assert_allclose(points[:4].mean(axis=0)[:2], grid_map.position, atol=1e-9)
    # Each side changes one coordinate only.
    assert (np.count_nonzero(np.diff(points, axis=0), axis=1) == 1).all()


def test_map_without_layers_has_a_region_of_the_given_width():
    marker = drawn(GridMap((2, 1), 0.5), line_width=0.1)
    assert (len(marker.points), marker.scale.x) == (5, 0.1)
