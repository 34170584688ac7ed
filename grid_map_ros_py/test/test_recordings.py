# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of the C++ nodes survive a round trip through the conversions."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from cpp_recordings import Recorded, bits, recorded
from nav_msgs.msg import GridCells, OccupancyGrid
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Image, PointCloud2

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import (
    add_color_layer_from_image,
    from_image,
    from_message,
    to_grid_cells,
    to_message,
    to_occupancy_grid,
    to_point_cloud,
)

TUTORIAL, FILTERS, MOVE = "cpp_tutorial", "cpp_filters", "cpp_move"
TRAVERSABILITY = ["traversability", 0.0, 1.0]

MAPS = [
    (TUTORIAL, "grid_map"),
    (FILTERS, "grid_map"),
    (FILTERS, "filtered_map"),
    (MOVE, "grid_map"),
]


def only_map(file: str, topic: str) -> GridMap:
    (one,) = recorded(file, topic, GridMapMessage)
    return from_message(one.message, unwrap=False)


def assert_is_recorded(message: Any, published: Recorded) -> None:
    # Same fields, same number of bytes: only padding bytes may differ.
    assert bits(message) == bits(published.message)
    assert len(serialize_message(message)) == len(published.raw)


@pytest.mark.parametrize(("file", "topic"), MAPS)
def test_every_map_is_republished_unchanged(file: str, topic: str) -> None:
    for published in recorded(file, topic, GridMapMessage):
        sent = to_message(from_message(published.message, unwrap=False))
        assert_is_recorded(sent, published)
        for ours, theirs in zip(sent.data, published.message.data, strict=True):
            payload = ours.data.tobytes()
            assert payload == theirs.data.tobytes()
            assert payload in published.raw


@pytest.mark.parametrize(
    ("file", "topic", "message_type", "convert", "options"),
    [
        (TUTORIAL, "elevation_points", PointCloud2, to_point_cloud, ["elevation"]),
        (TUTORIAL, "noisy_points", PointCloud2, to_point_cloud, ["elevation_noisy"]),
        (TUTORIAL, "filtered_points", PointCloud2, to_point_cloud, ["elevation_filtered"]),
        (TUTORIAL, "elevation_grid", OccupancyGrid, to_occupancy_grid, ["elevation", 0.08, -0.16]),
        (TUTORIAL, "error_grid", OccupancyGrid, to_occupancy_grid, ["error", -0.15, 0.15]),
        (FILTERS, "traversability_grid", OccupancyGrid, to_occupancy_grid, TRAVERSABILITY),
        (TUTORIAL, "elevation_cells", GridCells, to_grid_cells, ["elevation", -0.08, 0.0]),
    ],
)
def test_messages_equal_the_cpp_recording(
    file: str, topic: str, message_type: type, convert: Callable[..., Any], options: list[Any]
) -> None:
    (published,) = recorded(file, topic, message_type)
    grid_map = only_map(file, "filtered_map" if file == FILTERS else "grid_map")
    assert_is_recorded(convert(grid_map, *options), published)


def test_occupancy_grids_of_moving_map_equal_cpp() -> None:
    maps = {
        (stamp.sec, stamp.nanosec): from_message(r.message, unwrap=False)
        for r in recorded(MOVE, "grid_map", GridMapMessage)
        for stamp in [r.message.header.stamp]
    }
    compared = 0
    for published in recorded(MOVE, "occupancy_grid", OccupancyGrid):
        stamp = published.message.header.stamp
        grid_map = maps.get((stamp.sec, stamp.nanosec))
        if grid_map is not None:
            grid = to_occupancy_grid(grid_map, "layer", 0.0, 1.0)
            assert_is_recorded(grid, published)
            compared += 1
    assert compared > 20


def test_image_becomes_the_map_that_cpp_made_of_it() -> None:
    (published,) = recorded(FILTERS, "image", Image)
    expected = only_map(FILTERS, "grid_map")
    made = from_image(published.message, "elevation", expected.resolution, -0.5, 1.0)
    assert (made.size, made.frame_id) == (expected.size, expected.frame_id)
    np.testing.assert_allclose(made["elevation"], expected["elevation"], atol=1e-6)
    assert np.isnan(made["elevation"]).any()
    # The image is gray, so that the order of colors does not matter; C++ ignores alpha here.
    add_color_layer_from_image(made, published.message)
    known = np.isfinite(made["elevation"])
    np.testing.assert_array_equal(made["color"][known], expected["color"][known])
    assert np.isnan(made["color"][~known]).all()
