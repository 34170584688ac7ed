# SPDX-License-Identifier: BSD-3-Clause
"""The `point_cloud_to_grid_map` node as a process, over DDS."""

import math
from itertools import count

import numpy as np
from clouds import xyz_cloud
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import PointCloud2
from test_poses import pose

from conftest import arguments
from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message
from grid_map_ros_py.messages import to_stamp
from grid_map_ros_py.nodes._poses import from_xyz_rpy, has_tf
from grid_map_ros_py.testing import Peer, peer, running_node

MODULE = "grid_map_ros_py._executables.point_cloud_to_grid_map"
SIDE = 0.5
"""Side of a cell [m]."""


def ground(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the height of the ground, which is constant within every cell."""
    return np.sin(1.7 * np.floor(x / SIDE)) + 0.3 * np.cos(2.3 * np.floor(y / SIDE))


def pose_at(step: int) -> tuple[float, float, float]:
    """Return x, y and yaw of a robot that drives a curve."""
    return 0.1 * step, 2.0 * math.sin(0.05 * step), 0.2 * step


def seen(step: int) -> np.ndarray:
    """Return the centers (N, 2) of the cells around the robot."""
    axis = SIDE * np.arange(-2, 3)
    center = SIDE * (np.floor(np.array(pose_at(step)[:2]) / SIDE) + 0.5)
    return center + np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def cloud(step: int) -> PointCloud2:
    """Return the cells around the robot in the frame of its sensor, which looks to the left.

    Every third cloud is broken.
    """
    x, y, yaw = pose_at(step)
    sensor = from_xyz_rpy((x, y, 0.0), (0.0, 0.0, yaw + math.pi / 2))
    points = np.column_stack([seen(step), ground(*seen(step).T)])
    message = xyz_cloud((points - sensor[:3, 3]) @ sensor[:3, :3], "lidar")
    message.header.stamp = to_stamp(step)
    if step % 3 == 0:
        message.data = message.data[:-1]
    return message


def drive(other: Peer) -> None:
    """Publish odometry and clouds ten times a second while `other` spins."""
    steps = count(1)
    odometry = other.node.create_publisher(Odometry, "/odom", 10)
    clouds = other.node.create_publisher(PointCloud2, "/points", qos_profile_sensor_data)

    def publish() -> None:
        step = next(steps)
        odometry.publish(pose(1e-9 * step, *pose_at(step), Odometry))
        clouds.publish(cloud(step))

    other.node.create_timer(0.1, publish)


def assert_saw_the_way(maps: list[GridMap]) -> None:
    for grid_map in maps:
        # Every third cloud was broken.
        assert grid_map.timestamp % 3 != 0
        heights = grid_map.unwrapped("elevation")
        x, y = grid_map.geometry.axes_in_map_order()
        expected = np.where(np.isfinite(heights), ground(x[:, None], y[None, :]), np.nan)
        np.testing.assert_allclose(heights, expected, atol=1e-4)
        x, y, _ = pose_at(grid_map.timestamp)
        np.testing.assert_allclose(grid_map.position, (x, y), atol=0.5 * SIDE + 1e-6)
    last = maps[-1]
    cells, inside = last.get_indices(seen(last.timestamp))
    assert inside.all()
    assert np.isfinite(last["elevation"][cells]).all()
    assert np.isfinite(last["elevation"]).sum() > len(cells[0])
    assert last["count"].max() > 1


def test_mapping_survives_a_restart_and_broken_clouds(other_side: Peer) -> None:
    options = arguments(
        # Where tf is not installed, `auto` must detect that.
        pose_source="odometry" if has_tf() else "auto",
        resolution=SIDE,
        length=[12, 6],
        sensor_rpy=[0.0, 0.0, math.pi / 2],
        fusion="mean",
    )
    other_side.listen("/grid_map", GridMapMessage)
    maps = other_side.received["/grid_map"]
    drive(other_side)
    for _ in range(2):
        maps.clear()
        with running_node(MODULE, *options) as node:
            other_side.wait_until(lambda: len(maps) >= 8, "maps of a moving robot")
            other_side.wait_until(lambda: "dropped a cloud" in node.text, "a report")
        assert "poses: odometry" in node.text
        assert "dropped a cloud: data: expected" in node.text
        assert_saw_the_way([*map(from_message, maps)])
        assert {m.outer_start_index for m in maps} != {0}


def test_fixed_map_is_published_at_a_rate_and_latched(other_side: Peer) -> None:
    options = arguments(
        pose_source="none",
        robot_centric=False,
        map_frame="/map",
        input_reliability="reliable",
        queue_size=50,
        publish_rate=5,
        statistics_period=0.2,
        length=[4, 4],
        position=[2.0, 0.0],
        resolution=1,
    )
    other_side.listen("/grid_map", GridMapMessage)
    with running_node(MODULE, *options) as node:
        for height in range(20):
            other_side.publish("/points", xyz_cloud([(0.5, 0.5, height)]), 50)
        other_side.publish("/points", xyz_cloud([(9.0, 0.5, 3.0)]), 50)
        other_side.publish("/points", xyz_cloud([(0.5, 0.5, 3.0)], "lidar"), 50)
        other_side.wait_until(lambda: "21 clouds with 21 points fused" in node.text, "statistics")
        other_side.wait_until(lambda: "; 1 clouds dropped" in node.text, "the cloud that is wrong")
        other_side.listen("/diagnostics", DiagnosticArray, 10)
        reason = "header.frame_id: expected 'map', that of the map, as there are no"
        assert reason in node.text
        few = (
            "/points: few points: used 0 of 1 points because 1 are outside the map. Check the pose"
        )
        assert few in node.text
        found = other_side.expect("/diagnostics").status[0]
        values = {value.key: value.value for value in found.values}
        counts = [values[f"clouds {name}"] for name in ("in", "out", "dropped")]
        assert (counts, found.level) == (["22", "21", "1"], DiagnosticStatus.WARN)
        assert few in found.message
        assert reason in values["last error"]
        with peer() as late:
            late.listen("/grid_map", GridMapMessage)
            late.wait_until(
                lambda: any(is_done(m) for m in late.received["/grid_map"]), "the whole map"
            )
    assert 1 <= len(other_side.received["/grid_map"]) <= 20


def is_done(message: GridMapMessage) -> bool:
    grid_map = from_message(message)
    assert (grid_map.frame_id, grid_map.size) == ("map", (4, 4))
    return bool(grid_map.at_position("elevation", (0.5, 0.5)) == 19.0)
