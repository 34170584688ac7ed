# SPDX-License-Identifier: BSD-3-Clause
"""Benchmarks of `from_point_cloud`, in yardsticks only; C++ has no counterpart."""

import array

import numpy as np
import pytest
from bench_point_cloud import CELLS, ORACLES, POINTS, SIDE, by_cell, cloud
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from terrain import RESOLUTION

from grid_map_core_py import GridGeometry, color_value_to_vector
from grid_map_core_py.elevation import RollingMap
from grid_map_ros_py import from_point_cloud, read_points

# x, y, z, rgb and intensity, in the memory layout of the Point Cloud Library.
POINT = np.dtype(
    {
        "names": ["x", "y", "z", "rgb", "intensity"],
        "formats": ["<f4", "<f4", "<f4", "<u4", "<f4"],
        "offsets": [0, 4, 8, 16, 20],
        "itemsize": 32,
    }
)
DATATYPES = {"<f4": PointField.FLOAT32, "<u4": PointField.UINT32}
GEOMETRY = GridGeometry(np.array([SIDE, SIDE]), RESOLUTION)


def message() -> PointCloud2:
    """Return a cloud of a million points, as received: serialized and deserialized."""
    points = np.zeros(POINTS, POINT)
    points["x"], points["y"], points["z"] = cloud().T
    points["rgb"] = 0x010101 * (np.arange(POINTS, dtype=np.uint32) % 256)
    points["intensity"] = points["x"]
    fields = [
        PointField(name=name, offset=offset, datatype=DATATYPES[dtype.str], count=1)
        for name, (dtype, offset) in POINT.fields.items()
    ]
    data = array.array("B")
    data.frombytes(points.tobytes())
    sent = PointCloud2(height=1, width=POINTS, fields=fields, point_step=POINT.itemsize)
    sent.row_step, sent.data = len(data), data
    return deserialize_message(serialize_message(sent), PointCloud2)


def assert_reduced(received: PointCloud2, layer: np.ndarray, reduction: str) -> None:
    points = read_points(received)
    xyz = np.column_stack([points[axis] for axis in "xyz"])
    cells, heights = by_cell(xyz, from_point_cloud(received, onto=GEOMETRY, fields=[]))
    some = slice(None, None, 50)
    expected = [ORACLES[reduction](values) for values in heights[some]]
    np.testing.assert_allclose(layer[tuple(cells[some].T)], expected, rtol=1e-4)


@pytest.mark.parametrize("reduction", ["max", "mean", "median", "last"])
def test_from_point_cloud(measure, reduction):
    received = message()
    convert = lambda: from_point_cloud(  # noqa: E731
        received, reduction=reduction, onto=GEOMETRY, fields=[]
    )
    result = measure(f"fromPointCloud 1e6 points, {reduction}", CELLS, convert)
    assert_reduced(received, result["elevation"], reduction)


def test_from_point_cloud_with_colors(measure):
    received = message()
    convert = lambda: from_point_cloud(received, onto=GEOMETRY, fields=["rgb"])  # noqa: E731
    result = measure("fromPointCloud 1e6 points, max and rgb", CELLS, convert)
    assert_reduced(received, result["elevation"], "max")
    # All colors are gray, so the mean colors must be gray.
    colors = color_value_to_vector(result["color"])
    np.testing.assert_array_equal(colors[..., 0], colors[..., 2])


def test_from_point_cloud_made_to_fit(measure):
    received = message()
    convert = lambda: from_point_cloud(received, resolution=RESOLUTION, fields=[])  # noqa: E731
    result = measure("fromPointCloud 1e6 points, made to fit", CELLS, convert)
    assert result.is_inside(cloud()[:, :2]).all()


@pytest.mark.parametrize("fusion", ["max", "mean"])
def test_fuse(measure, fusion):
    points = cloud(100_000)
    rolling = RollingMap(GEOMETRY, fusion=fusion)
    steps = np.linspace(0.0, 0.2 * SIDE, 50)
    count = iter(range(10**9))
    position = lambda: (steps[next(count) % len(steps)], 0.0)  # noqa: E731
    row = f"fuse 1e5 points into a moving map, {fusion}"
    measure(row, CELLS, lambda: rolling.fuse(points, position=position()))
    rolling.fuse(points)
    on_map = rolling.grid_map.is_inside(points[:, :2])
    cells, _ = rolling.grid_map.get_indices(points[on_map, :2])
    assert np.isfinite(rolling.grid_map["elevation"][cells]).all()
