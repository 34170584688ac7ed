# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Vectors, against a loop over the cells."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap, map_cells
from grid_map_core_py.testing import grid_maps
from grid_map_visualization_py.builtin._vectors import VectorsVisualization

LAYERS = ("height", "normal_x", "normal_y", "normal_z")
PARAMETERS = {"layer_prefix": "normal_", "position_layer": "height"}


def drawn(grid_map: GridMap, **parameters: object) -> Marker:
    return deserialize_message(VectorsVisualization(**PARAMETERS | parameters)(grid_map), Marker)


def coordinates(marker: Marker) -> list[tuple[float, float, float]]:
    return [(point.x, point.y, point.z) for point in marker.points]


def lines_by_loop(grid_map: GridMap, scale: float) -> list[tuple[float, float, float]]:
    points = []
    for cell in zip(*map_cells(grid_map), strict=True):
        start = grid_map.get_position3("height", cell)
        vector = grid_map.get_vector("normal_", cell)
        if np.isfinite([start, vector]).all():
            points += [tuple(start), tuple(start + scale * vector)]
    return points


@settings(max_examples=60)
@given(grid_maps(LAYERS, max_side=6), st.sampled_from([0.06, 1.0, -2.5]))
def test_valid_cells_get_lines_in_buffer_order(grid_map, scale):
    marker = drawn(grid_map, scale=scale)
    assert coordinates(marker) == lines_by_loop(grid_map, scale)
    assert len(marker.colors) == len(marker.points)


def test_basic_layers_do_not_matter():
    grid_map = GridMap((2, 1), 1.0, layers=dict.fromkeys(LAYERS, 1.0) | {"color": np.nan})
    grid_map.basic_layers = ["color"]
    assert len(drawn(grid_map).points) == 4


def test_map_without_a_valid_cell_is_drawn_as_no_line():
    marker = drawn(GridMap((1, 1), 1.0, layers=LAYERS))
    assert (list(marker.points), list(marker.colors)) == ([], [])


def test_marker_has_frame_time_width_and_opaque_colors():
    grid_map = GridMap(
        (1, 1), 1.0, layers=dict.fromkeys(LAYERS, 1.0), frame_id="odom", timestamp=3_000_000_007
    )
    marker = drawn(grid_map, line_width=0.25, color=0xFF8000)
    assert (marker.header.frame_id, marker.ns) == ("odom", "vector")
    assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (3, 7)
    assert (marker.type, marker.action) == (Marker.LINE_LIST, Marker.ADD)
    assert (marker.scale.x, marker.pose.orientation.w) == (0.25, 1.0)
    assert [(c.r, c.g, c.b, c.a) for c in marker.colors] == [
        pytest.approx((1.0, 128 / 255, 0.0, 1.0))
    ] * 2
