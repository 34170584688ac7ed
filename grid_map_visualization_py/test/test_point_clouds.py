# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The two point clouds that are not in the recordings."""

import numpy as np

from grid_map_core_py import GridMap
from grid_map_visualization_py.builtin import FlatPointCloudVisualization, PointCloudVisualization


def points(cloud) -> np.ndarray:
    names = [field.name for field in cloud.fields]
    values = np.frombuffer(cloud.data, "<f4").reshape(cloud.width, -1)
    return values[:, [names.index(axis) for axis in "xyz"]]


def holey_map() -> GridMap:
    return GridMap((3, 1), 1.0, layers={"elevation": [[1.0], [np.nan], [3.0]]})


def test_point_cloud_shows_elevation_by_default():
    assert points(PointCloudVisualization()(holey_map())).tolist() == [[1, 0, 1], [-1, 0, 3]]


def test_point_cloud_that_is_flat_needs_no_layer():
    cloud = PointCloudVisualization(layer="no such layer", flat=True)(holey_map())
    assert points(cloud).tolist() == [[1, 0, 0], [0, 0, 0], [-1, 0, 0]]


def test_flat_point_cloud_leaves_out_cells_without_basic_layers():
    grid_map = holey_map()
    grid_map.basic_layers = ["elevation"]
    assert len(points(FlatPointCloudVisualization()(grid_map))) == 2
    assert grid_map.layers == ("elevation",)
