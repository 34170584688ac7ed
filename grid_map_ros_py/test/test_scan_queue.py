# SPDX-License-Identifier: BSD-3-Clause
"""Fusion of clouds that wait for their poses, and rejection of bad clouds."""

import array
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from clouds import UINT32, packed_cloud, xyz_cloud, xyz_fields
from sensor_msgs.msg import PointCloud2
from test_poses import SECOND, history, pose
from wire import set_field

from grid_map_core_py import ConfigError, GridGeometry
from grid_map_core_py.elevation import RollingMap
from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py.messages import to_stamp
from grid_map_ros_py.nodes._poses import Placement, Poses, from_xyz_rpy
from grid_map_ros_py.nodes._scans import Cloud, ScanQueue, read_cloud


class Mapper(ScanQueue):
    """Queue that keeps its reports, and whose clock `now` the test sets."""

    def __init__(self, poses: Poses, fields: Sequence[str] = (), **options: Any) -> None:
        self.reports: list[str] = []
        self.now = 0.0
        self.rolling_map = RollingMap(GridGeometry(np.array([8.0, 6.0]), 1.0), "odom")
        read = partial(read_cloud, fields=fields)
        report, clock = self.reports.append, lambda: self.now
        super().__init__(poses, read, self.fuse_rolling, report, clock=clock, **options)

    def fuse_rolling(self, scan: Cloud, placement: Placement) -> None:
        self.rolling_map.fuse(
            scan.points,
            scan.columns,
            transform=placement.transform,
            position=placement.center,
            timestamp=scan.stamp,
        )


def fixed_mapper(**options: Any) -> Mapper:
    return Mapper(Poses("odom"), **options)


def cloud(seconds: float, *points: tuple[float, float, float], frame: str = "lidar") -> PointCloud2:
    message = xyz_cloud(points or [(0.5, 0.5, seconds)], frame)
    message.header.stamp = to_stamp(round(seconds * SECOND))
    return message


def test_clouds_wait_for_their_poses_and_are_fused_in_order() -> None:
    poses = history(pose(1))
    made = Mapper(poses)
    assert not made.add(cloud(2))
    assert not made.add(cloud(3))
    assert not made.work()
    for seconds, fused in ((2.5, 2), (3, 3)):
        poses.add(pose(seconds))
        assert made.work()
        assert made.rolling_map.grid_map.timestamp == fused * SECOND
    assert not made.work()
    assert (made.statistics.fused, made.reports) == (2, [])


def test_clouds_without_pose_are_dropped_after_timeout() -> None:
    made = Mapper(history(pose(1)), timeout=0.5)
    made.add(cloud(2))
    made.now = 0.4
    made.add(cloud(3))
    assert made.reports == []
    made.now = 0.5
    made.work()
    text = "dropped a cloud: it waited 0.5 s for a later pose than that of 1.000 s"
    assert made.reports == [text]
    made.now = 0.9
    made.work()
    assert made.statistics.dropped == 2


def test_queue_size_limits_waiting_clouds() -> None:
    poses = history()
    made = Mapper(poses, queue_size=2)
    for seconds in (1, 2, 3):
        made.add(cloud(seconds))
    assert made.reports == ["dropped a cloud: 2 newer ones wait for poses"]
    poses.add(pose(2))
    poses.add(pose(3))
    made.work()
    assert made.statistics.fused == 2


def test_waiting_cloud_does_not_delay_other_frames() -> None:
    class OnlyLidar(Poses):
        def place(self, frame_id: str, stamp: int) -> Placement | None:
            return super().place("odom", stamp) if frame_id == "lidar" else None

    made = Mapper(OnlyLidar("odom"))
    assert not made.add(cloud(1, frame="camera"))
    assert made.add(cloud(2))
    assert (made.statistics.fused, made.reports) == (1, [])


def test_outdated_cloud_does_not_delay_the_next() -> None:
    made = Mapper(history(pose(5), pose(6)))
    assert not made.add(cloud(1))
    assert made.add(cloud(5.5))
    assert made.reports == ["dropped a cloud: no pose at 1.000 s: the first one is of 5.000 s"]


def test_clouds_of_a_bag_that_loops_take_its_new_poses() -> None:
    poses = history(pose(1), pose(60, 30.0))
    made = Mapper(poses)
    assert made.add(cloud(60))
    assert not made.add(cloud(61))
    # The first cloud after the jump comes before the first pose.
    assert not made.add(cloud(1.5))
    assert made.reports == ["dropped a cloud: its time is 59.5 s after that of the next"]
    poses.add(pose(1))
    poses.add(pose(2, 2.0))
    assert made.work()
    assert made.rolling_map.grid_map.position[0] == 1.0
    assert made.add(cloud(1.2))
    assert made.statistics.fused == 3


@pytest.mark.parametrize(
    ("path", "value", "reason"),
    [
        ("data", array.array("B", bytes(11)), "data: expected 12 bytes"),
        ("fields[2].name", "height", "fields: expected one called 'z'"),
        ("header.stamp.sec", -1, "header.stamp.sec: expected no negative number"),
        ("header.frame_id", "map", "header.frame_id: expected 'odom'"),
    ],
)
def test_bad_cloud_is_reported_and_changes_nothing(path: str, value: Any, reason: str) -> None:
    made = fixed_mapper()
    made.add(cloud(1, frame="odom"))
    before = made.rolling_map.grid_map.copy()
    bad = cloud(2, frame="odom")
    set_field(bad, path, value)
    assert not made.add(bad)
    assert_maps_equal(made.rolling_map.grid_map, before)
    (report,) = made.reports
    assert report.startswith(f"dropped a cloud: {reason}")
    assert (made.statistics.fused, made.statistics.dropped) == (1, 1)


def test_robot_at_huge_position_changes_nothing() -> None:
    made = Mapper(history(pose(1), pose(2, 1e300)))
    made.add(cloud(1))
    before = made.rolling_map.grid_map.copy()
    assert not made.add(cloud(2))
    assert_maps_equal(made.rolling_map.grid_map, before)
    assert "too far away" in made.reports[0]


def test_fields_become_layers_if_they_are_asked_for() -> None:
    points = [{"x": 0.5, "y": 0.5, "z": 1.0, "rgb": 0x112233}]
    message = packed_cloud(points, [*xyz_fields(), ("rgb", 12, UINT32, 1)], frame_id="odom")
    plain, colored = fixed_mapper(), fixed_mapper(fields=["rgb"])
    plain.add(message)
    colored.add(message)
    assert plain.rolling_map.grid_map.layers == ("elevation",)
    assert colored.rolling_map.grid_map.layers == ("elevation", "color")
    colored.add(cloud(2, frame="odom"))
    text = "dropped a cloud: fields: expected one called 'rgb', got ['x', 'y', 'z']"
    assert colored.reports == [text]


@pytest.mark.parametrize(
    ("points", "missing", "unused", "text"),
    [
        (2.5, 0, {"outside the map": 396}, ""),
        (2.5, 0, {"outside the map": 9, "not finite": 388}, "3 of 400 points because 388 are n"),
        (2500.0, 0, {"outside the map": 400}, "The median range is 2500 m: convert millimeters"),
        (2.5, 9, {"farther than max_range": 400}, "400 are farther than max_range, 9 are without"),
        (math.nan, 0, {"not finite": 400}, "0 of 400 points because 400 are not finite"),
        (None, 0, {}, "used 0 of 0 points because the message is empty. Check the sensor"),
        (None, 4, {}, "used 0 of 4 points because 4 are without a depth. Check the camera"),
    ],
)
def test_few_used_points_have_reasons_and_a_remedy(points, missing, unused, text) -> None:
    cloud = np.empty((0, 3)) if points is None else np.full((400, 3), (0.0, 0.0, points))
    found = Cloud("lidar", 1, cloud, missing=missing).usage(unused)
    assert (text in found, bool(found)) == (True, bool(text))


@pytest.mark.parametrize(
    ("frame", "is_optical", "rpy", "tilt", "is_refused"),
    [
        ("front_optical_frame", False, (0, 0, 0), 0.0, True),
        ("front_optical_frame", False, (-math.pi / 2, 0, -math.pi / 2), 0.0, False),
        ("front_link", False, (0, 0, 0), 0.0, False),
        ("front_link", True, (0, 0, 0), 0.0, True),
        # Poses of the camera itself, without a robot.
        ("front_optical_frame", True, (0, 0, 0), -math.pi / 2, False),
    ],
)
def test_optical_frame_without_rotation_is_refused(
    frame, is_optical, rpy, tilt, is_refused
) -> None:
    robot = from_xyz_rpy((0, 0, 1), (tilt, 0, 0.5))
    placement = Placement(robot @ from_xyz_rpy((0, 0, 0), rpy), robot)
    queue = fixed_mapper()
    queue.poses.place = lambda *_: placement
    queue.read = lambda message: replace(read_cloud(message), is_optical=is_optical)
    assert queue.add(cloud(1, frame=frame)) == (not is_refused)
    assert (f"got '{frame}' with z up. Publish" in str(queue.reports)) == is_refused


@pytest.mark.parametrize("wrong", [{"timeout": -1}, {"queue_size": 0}])
def test_wrong_settings_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="expected"):
        fixed_mapper(**wrong)
