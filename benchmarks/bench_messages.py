# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of conversions between maps and messages."""

import numpy as np
import pytest
from nav_msgs.msg import GridCells
from rclpy.serialization import deserialize_message
from terrain import terrain

from grid_map_core_py.testing import assert_maps_equal
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import (
    from_message,
    from_occupancy_grid,
    from_serialized_message,
    to_message,
    to_occupancy_grid,
    to_point_cloud,
    to_serialized_grid_cells,
    to_serialized_message,
)

LAYERS = pytest.mark.parametrize("layers", [1, 4])


def plural(layers):
    return "1 layer" if layers == 1 else f"{layers} layers"


@LAYERS
def test_to_message(measure, cells, layers):
    grid_map = terrain(cells, layers=layers)
    message = measure(f"toMessage {plural(layers)}", cells, lambda: to_message(grid_map))
    payload = np.array(message.data[-1].data).reshape(grid_map.size, order="F")
    np.testing.assert_array_equal(payload, grid_map[grid_map.layers[-1]])


@LAYERS
def test_from_message(measure, cells, layers):
    grid_map = terrain(cells, layers=layers)
    message = to_message(grid_map)
    result = measure(f"fromMessage {plural(layers)}", cells, lambda: from_message(message))
    assert_maps_equal(result, grid_map)


@LAYERS
def test_copy_of_the_payload(measure, cells, layers):
    payload = payload_of(terrain(cells, layers=layers))
    copied = measure(f"copy of the payload, {plural(layers)}", cells, payload.copy)
    np.testing.assert_array_equal(copied, payload)


@LAYERS
def test_to_serialized_message(measure, cells, layers):
    grid_map = terrain(cells, layers=layers)
    row = f"toSerializedMessage {plural(layers)}"
    data = measure(row, cells, lambda: to_serialized_message(grid_map))
    assert_maps_equal(from_message(deserialize_message(data, GridMapMessage)), grid_map)


@LAYERS
def test_from_serialized_message(measure, cells, layers):
    grid_map = terrain(cells, layers=layers)
    data = to_serialized_message(grid_map)
    row = f"fromSerializedMessage {plural(layers)}"
    result = measure(row, cells, lambda: from_serialized_message(data))
    assert_maps_equal(result, grid_map)
    np.testing.assert_array_equal(payload_of(result), payload_of(grid_map))


def payload_of(grid_map):
    """Return the values of all layers in one array."""
    return np.concatenate([grid_map[name].ravel("F") for name in grid_map])


@LAYERS
def test_to_point_cloud(measure, cells, layers):
    grid_map = terrain(cells, layers=layers)
    row = f"toPointCloud {plural(layers)}"
    cloud = measure(row, cells, lambda: to_point_cloud(grid_map, "elevation"))
    points = np.frombuffer(cloud.data, np.float32).reshape(-1, 2 + layers)
    known = np.isfinite(grid_map["elevation"]).ravel("F")
    np.testing.assert_array_equal(points[:, 2], grid_map["elevation"].ravel("F")[known])
    np.testing.assert_allclose(points[:, :2], grid_map.get_positions()[known], atol=1e-5)


def test_to_occupancy_grid(measure, cells):
    grid_map = terrain(cells)
    convert = lambda: to_occupancy_grid(grid_map, "elevation", -0.5, 0.5)  # noqa: E731
    grid = measure("toOccupancyGrid", cells, convert)
    values = np.array(grid.data, np.float64)[::-1].reshape(grid_map.size, order="F")
    known = np.isfinite(grid_map["elevation"])
    expected = 100 * (grid_map["elevation"][known] + 0.5)
    np.testing.assert_allclose(values[known] + 0.5, expected, atol=0.51)
    assert (values[~known] == -1).all()


def test_from_occupancy_grid(measure, cells):
    grid = to_occupancy_grid(terrain(cells), "elevation", -0.5, 0.5)
    result = measure("fromOccupancyGrid", cells, lambda: from_occupancy_grid(grid, "occupancy"))
    expected = np.array(grid.data, np.float32)[::-1].reshape(result.size, order="F")
    expected[expected == -1] = np.nan
    np.testing.assert_array_equal(result["occupancy"], expected)


def test_to_grid_cells(measure, cells):
    grid_map = terrain(cells)
    convert = lambda: to_serialized_grid_cells(grid_map, "elevation", 0.0, 1.0)  # noqa: E731
    data = measure("toGridCells [0,1]", cells, convert)
    centers = [(cell.x, cell.y) for cell in deserialize_message(data, GridCells).cells]
    assert len(centers) == np.count_nonzero(grid_map["elevation"] >= 0)
    indices, _ = grid_map.get_indices(centers)
    assert (grid_map["elevation"][indices] >= 0).all()
