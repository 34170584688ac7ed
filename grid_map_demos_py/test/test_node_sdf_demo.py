# SPDX-License-Identifier: BSD-3-Clause
"""The signed distance field of a map as point clouds."""

import numpy as np
import pytest
from demos import parameters
from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridMap, GridMapError, LayerNotFoundError
from grid_map_demos_py.sdf_demo_node import distance_field
from grid_map_ros_py import to_message
from grid_map_ros_py.testing import peer, running_node

MODULE = "sdf_demo_node"
CLOUDS = ("full_sdf", "free_space", "occupied_space")


def level_ground(**layers: float) -> GridMap:
    return GridMap((2.0, 1.0), 0.1, layers=layers, frame_id="odom", timestamp=1_500_000_007)


def points(message: PointCloud2) -> np.ndarray:
    """Return x, y, z and intensity (N, 4)."""
    assert [field.name for field in message.fields] == ["x", "y", "z", "intensity"]
    assert [field.offset for field in message.fields] == [0, 4, 8, 12]
    assert (message.point_step, message.row_step) == (16, 16 * message.width)
    return np.frombuffer(message.data, "<f4").reshape(message.width, 4)


def test_the_field_reaches_a_little_beyond_the_heights():
    grid_map = level_ground(elevation=0.0)
    grid_map["elevation"][:10] = 0.5
    field = distance_field(grid_map, "elevation")
    assert field.levels[0] == pytest.approx(-0.1)
    assert 0.6 - 1e-6 <= field.levels[-1] < 0.7


def test_cells_without_a_height_count_as_low_as_the_lowest():
    grid_map = level_ground(elevation=0.2)
    grid_map["elevation"][:10] = 0.5
    filled = distance_field(grid_map, "elevation").distances
    grid_map["elevation"][12:, 3:5] = [np.nan, np.inf]
    np.testing.assert_array_equal(distance_field(grid_map, "elevation").distances, filled)


def test_a_map_without_heights_has_no_field():
    with pytest.raises(GridMapError, match="layer 'elevation': expected heights, got no finite"):
        distance_field(level_ground(elevation=np.nan), "elevation")
    with pytest.raises(LayerNotFoundError):
        distance_field(level_ground(height=0.0), "elevation")


@pytest.mark.parametrize(("size", "height"), [((0.2, 0.1), 1e4), ((20.0, 10.0), 200.0)])
def test_outlier_height_is_refused(size, height):
    grid_map = GridMap(size, 0.1, layers={"elevation": 0.0})
    grid_map["elevation"][0, 0] = height
    with pytest.raises(GridMapError, match="layer 'elevation': expected a field of at most 10000"):
        distance_field(grid_map, "elevation")


def test_demo_publishes_the_field_and_its_two_parts():
    prefix = "/grid_map_sdf_demo/signed_distance_field"
    with peer() as other:
        for cloud in CLOUDS:
            other.listen(f"{prefix}/{cloud}", PointCloud2)
        with running_node(f"grid_map_demos_py.{MODULE}"):
            other.publish("/grid_map", to_message(level_ground(elevation=0.25)))
            full, free, occupied = (other.expect(f"{prefix}/{cloud}") for cloud in CLOUDS)
            assert full.header.frame_id == "odom"
            assert (full.header.stamp.sec, full.header.stamp.nanosec) == (1, 500_000_007)
    full, free, occupied = points(full), points(free), points(occupied)
    # Over level ground the distance is the height above it.
    np.testing.assert_allclose(full[:, 3], full[:, 2] - 0.25, atol=1e-6)
    assert {*np.round(full[:, 2], 5)} == {np.float32(0.15), np.float32(0.25), np.float32(0.35)}
    assert len(full) == 20 * 10 * 3
    assert (free[:, 3] > 0).all()
    assert (occupied[:, 3] <= 0).all()
    assert (len(free), len(occupied)) == (200, 400)
    assert np.ptp(full[:, 0]) == pytest.approx(1.9)
    assert np.ptp(full[:, 1]) == pytest.approx(0.9)


def test_topics_and_layer_are_parameters():
    given = ["grid_map_topic:=/map", "pointcloud_topic:=/field", "elevation_layer:=height"]
    with peer() as other:
        other.listen("/field/full_sdf", PointCloud2)
        with running_node(f"grid_map_demos_py.{MODULE}", *parameters(*given)) as demo:
            other.publish("/map", to_message(level_ground(elevation=0.25)))
            complaint = "dropped a message of /map: no layer 'height'; available: elevation"
            other.wait_until(lambda: complaint in demo.text, "the complaint")
            other.publish("/map", to_message(level_ground(elevation=0.25, height=1.0)))
            cloud = points(other.expect("/field/full_sdf"))
    np.testing.assert_allclose(cloud[:, 3], cloud[:, 2] - 1.0, atol=1e-6)
