# SPDX-License-Identifier: BSD-3-Clause
"""Poses of robot and sensor, from messages and interpolated."""

import math
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Quaternion, TransformStamped
from nav_msgs.msg import Odometry

from grid_map_core_py import GridMapError
from grid_map_core_py.errors import MissingPackageError
from grid_map_ros_py import MessageError
from grid_map_ros_py.messages import to_stamp
from grid_map_ros_py.nodes._poses import (
    Placement,
    PoseHistory,
    Poses,
    TfPoses,
    between,
    carried,
    from_xyz_rpy,
    has_tf,
)

SECOND = 1_000_000_000


def pose(
    seconds: float,
    x: float = 0.0,
    y: float = 0.0,
    yaw: float = 0.0,
    kind: type = PoseStamped,
    frame_id: str = "odom",
) -> Any:
    message = kind()
    message.header.frame_id = frame_id
    message.header.stamp = to_stamp(round(seconds * SECOND))
    inner = message.pose if kind is PoseStamped else message.pose.pose
    inner.position.x, inner.position.y = x, y
    inner.orientation = Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return message


def history(*poses: Any, **options: Any) -> PoseHistory:
    made = PoseHistory("odom", **options)
    for message in poses:
        made.add(message)
    return made


def yaw_of(matrix: np.ndarray) -> float:
    return math.atan2(matrix[1, 0], matrix[0, 0])


# --- matrices -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("xyz", "rpy", "point", "expected"),
    [
        # Rotation about the fixed x axis, then y, then z.
        ((0, 0, 1), (math.pi / 2, 0, math.pi / 2), (0, 1, 0), (0, 0, 2)),
        ((0, 0, 1), (math.pi / 2, 0, math.pi / 2), (1, 0, 0), (0, 1, 1)),
        ((0, 0, 0), (0, math.pi / 2, 0), (1, 0, 0), (0, 0, -1)),
    ],
)
def test_roll_pitch_and_yaw_follow_urdf(xyz, rpy, point, expected) -> None:
    np.testing.assert_allclose(from_xyz_rpy(xyz, rpy) @ (*point, 1), (*expected, 1), atol=1e-12)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_between_two_poses_the_robot_turns_evenly_the_short_way(share: float) -> None:
    begin, end = from_xyz_rpy((0, 0, 0), (0, 0, 3.0)), from_xyz_rpy((4, 0, 2), (0, 0, -3.0))
    found = between(begin, end, share)
    np.testing.assert_allclose(found[:3, 3], (4 * share, 0, 2 * share))
    turned = 3.0 + share * (2 * math.pi - 6.0)
    assert math.cos(yaw_of(found) - turned) == pytest.approx(1.0)


# --- poses of a topic -----------------------------------------------------------------------------

WAY = [pose(1, 0.0), pose(2, 4.0, yaw=1.0), pose(4, 4.0)]
RESET = [pose(100, 1.0), pose(101, 1.0), pose(5, 9.0)]
LATE = [pose(1, 0.0), pose(2, 4.0), pose(1.999, 3.0), pose(3, 8.0)]
TWICE = [pose(1, 1.0), pose(2, 2.0), pose(2, 2.0), pose(3, 4.0)]


@pytest.mark.parametrize(
    ("poses", "seconds", "x", "yaw"),
    [
        *[(WAY, *expected) for expected in [(1, 0, 0), (1.25, 1, 0.25), (2, 4, 1), (3, 4, 0.5)]],
        # Time 0 stands for the latest pose.
        *[(WAY, 4, 4, 0), (WAY, 0, 4, 0)],
        # The clock was reset.
        (RESET, 5, 9, 0),
        # A pose is late by a millisecond.
        *[(LATE, *expected) for expected in [(1, 0, 0), (1.999, 3, 0), (2, 4, 0), (2.5, 6, 0)]],
        *[(TWICE, 1.5, 1.5, 0), (TWICE, 2, 2, 0), (TWICE, 2.5, 3, 0)],
        *[([pose(1, 3.0, kind=k)], 1, 3, 0) for k in (Odometry, PoseWithCovarianceStamped)],
    ],
)
def test_poses_are_known_at_and_between_their_times(poses, seconds, x, yaw) -> None:
    found = history(*poses).at(round(seconds * SECOND))
    assert found is not None
    assert (found[0, 3], yaw_of(found)) == (pytest.approx(x), pytest.approx(yaw))


@pytest.mark.parametrize(
    ("poses", "seconds", "waits_for"),
    [
        ([], 1, "poses"),
        ([], 0, "poses"),
        ([pose(1.5)], 2, "a later pose than that of 1.500 s"),
        (RESET, 100, "a later pose than that of 5.000 s"),
    ],
)
def test_cloud_waits_for_the_pose_that_follows(poses, seconds, waits_for) -> None:
    known = history(*poses)
    assert known.place("lidar", seconds * SECOND) is None
    assert known.waits_for == waits_for


@pytest.mark.parametrize(("limit", "first"), [(9, 2), (1, 3)])
def test_cloud_from_before_the_first_pose_is_refused(limit: int, first: int) -> None:
    known = history(pose(2), pose(3), limit=limit)
    with pytest.raises(
        GridMapError, match=rf"no pose at 1\.000 s: the first one is of {first}\.000 s"
    ):
        known.at(SECOND)
    with pytest.raises(GridMapError, match=r"50\.000 s; do scans and poses have the same cl"):
        history(pose(50)).at(SECOND)


def test_placement_has_pose_of_sensor_and_tracked_point() -> None:
    robot = pose(1, 10.0, 20.0, math.pi / 2, PoseWithCovarianceStamped)
    robot.pose.covariance = np.diag([0.1, 0.2, 0.3, 0.01, 0.02, 0.03]).ravel()
    sensor = from_xyz_rpy((2, 0, 0.5), (0, 0, 0))
    known = history(robot, sensor=sensor, track_point=(3.0, 0.0, 5.0), with_covariances=True)
    lidar, odom = (known.place(frame, SECOND) for frame in ("lidar", "odom"))
    np.testing.assert_allclose(lidar.transform[:3, 3], (10, 22, 0.5))
    np.testing.assert_array_equal(odom.transform[:3, 3], 0.0)
    for placement in (lidar, odom):
        np.testing.assert_allclose(placement.center, (10, 23))
        np.testing.assert_array_equal(known.frame_at("foot", SECOND), placement.robot)
    np.testing.assert_array_equal(known.frame_at("odom", SECOND), np.eye(4))
    # A roll of 0.01 rad^2 at 2 m.
    assert lidar.covariance[2, 2] == pytest.approx(0.3 + 4 * 0.01)
    assert odom.covariance is None


def test_frames_of_ros_1_lose_their_slash() -> None:
    assert Poses("/odom").place("/odom", 5) is not None
    known = PoseHistory("/odom")
    known.add(pose(1, 10.0))
    for frame in ("odom", "/odom"):
        np.testing.assert_array_equal(known.frame_at(frame, SECOND), np.eye(4))
        np.testing.assert_array_equal(known.place(frame, SECOND).transform, np.eye(4))


@pytest.mark.parametrize("kind", [PoseStamped, Odometry])
def test_invalid_pose_changes_nothing(kind: type) -> None:
    known = history(pose(1))
    elsewhere, nowhere = pose(2, kind=kind), pose(2, x=math.nan, kind=kind)
    elsewhere.header.frame_id = "map"
    with pytest.raises(MessageError, match=r"header\.frame_id: expected 'odom', that of the map"):
        known.add(elsewhere)
    with pytest.raises(MessageError, match=r"pose\.position\.x: expected a finite number"):
        known.add(nowhere)
    assert known.at(2 * SECOND) is None


def test_sensors_of_one_robot_share_its_poses() -> None:
    known = history()
    front, rear = (known.mounted(from_xyz_rpy((x, 0, 0), (0, 0, 0))) for x in (1.0, -1.0))
    known.add(pose(1, 10.0))
    assert front.place("front", SECOND).transform[0, 3] == 11.0
    assert rear.place("rear", SECOND).transform[0, 3] == 9.0
    assert rear.place("rear", 2 * SECOND) is None
    assert rear.waits_for == "a later pose than that of 1.000 s"
    known.go_back(SECOND // 2)
    assert front.place("front", SECOND)
    known.add(pose(9))
    known.go_back(SECOND)
    assert (front.place("front", SECOND), front.waits_for) == (None, "poses")


# --- covariances ----------------------------------------------------------------------------------


def uncertain(seconds: float, *variances: float) -> PoseWithCovarianceStamped:
    message = pose(seconds, kind=PoseWithCovarianceStamped)
    message.pose.covariance = np.diag(variances).ravel()
    return message


@pytest.mark.parametrize(
    ("seconds", "share"), [(0.5, 0), (1, 0), (1.25, 0.25), (2, 1), (9, 1), (0, 1)]
)
def test_covariance_is_interpolated_and_held_at_the_ends(seconds: float, share: float) -> None:
    first, last = np.arange(1.0, 7.0), np.full(6, 10.0)
    known = history(uncertain(1, *first), uncertain(2, *last), with_covariances=True)
    found = known.covariance_at(round(seconds * SECOND))
    np.testing.assert_allclose(found, np.diag(first + share * (last - first)))
    assert history(uncertain(1, *first)).covariance_at(SECOND) is None


def test_covariance_of_the_sensor_includes_its_lever() -> None:
    generator = np.random.default_rng(3)
    factor, lever = generator.normal(size=(6, 6)), np.array([0.4, -0.2, 1.1])
    covariance = factor @ factor.T
    step = 1e-6
    columns = []
    for axis in np.eye(6):
        change = from_xyz_rpy(step * axis[:3], step * axis[3:])
        moved = (change @ (*lever, 1.0))[:3] - lever
        columns.append(np.append(moved / step, axis[3:]))
    jacobian = np.array(columns).T
    expected = jacobian @ covariance @ jacobian.T
    np.testing.assert_allclose(carried(covariance, lever), expected, rtol=1e-5, atol=1e-4)
    assert carried(None, lever) is None


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_covariance_that_is_not_finite_is_refused_only_if_used(wrong: float) -> None:
    message = uncertain(1, 0.1, wrong, 0.1, 0.1, 0.1, 0.1)
    with pytest.raises(MessageError, match=r"pose\.covariance: expected 36 finite numbers"):
        history(message, with_covariances=True)
    assert history(message).at(SECOND) is not None


# --- tf -------------------------------------------------------------------------------------------


class TransformException(Exception):
    pass


class Tree:
    """Stand-in for tf2's buffer; it knows all poses after a certain time, and 0 is the latest."""

    def lookup_transform(self, target: str, source: str, time: Any) -> TransformStamped:
        if 0 < time.nanoseconds < SECOND or source == "arm":
            raise TransformException(f"no {source} in {target} yet")
        found = TransformStamped()
        found.header.stamp = to_stamp(time.nanoseconds or 5 * SECOND)
        found.transform.translation.x = {"lidar": 3.0, "base": 2.0, "foot": 1.0}[source]
        return found

    def clear(self) -> None:
        pass


@pytest.fixture
def tf2(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("tf2_ros")
    module.__spec__ = SimpleNamespace()
    module.Buffer = Tree
    module.TransformListener = lambda _buffer, _node: None
    module.TransformException = TransformException
    monkeypatch.setitem(sys.modules, "tf2_ros", module)


@pytest.mark.usefixtures("tf2")
@pytest.mark.parametrize(("robot_frame", "x"), [("/base", 2.0), ("", 3.0)])
def test_tf_gives_poses_of_cloud_and_robot(robot_frame: str, x: float) -> None:
    assert has_tf()
    poses = TfPoses(None, "/map", robot_frame)
    assert poses.place("lidar", SECOND - 1) is None
    assert poses.waits_for == "no lidar in map yet"
    placement = poses.place("lidar", SECOND)
    assert isinstance(placement, Placement)
    np.testing.assert_array_equal(placement.transform[:3, 3], (3, 0, 0))
    np.testing.assert_array_equal(placement.center, (x, 0))


@pytest.mark.usefixtures("tf2")
def test_tf_takes_covariances_from_a_topic() -> None:
    known = history(with_covariances=True)
    poses = TfPoses(
        None, "odom", "base", track_frame="foot", track_point=(0, 7, 0), covariances=known
    )
    assert poses.place("lidar", SECOND) is None
    assert poses.waits_for == "poses"
    known.add(uncertain(1, *[0.1] * 6))
    placement = poses.place("lidar", 3 * SECOND)
    np.testing.assert_array_equal(placement.center, (1, 7))
    # The lidar is 1 m before the base.
    assert placement.covariance[2, 2] == pytest.approx(0.2)
    poses.go_back(0)
    assert poses.frame_at("foot", SECOND - 1) is None


@pytest.mark.usefixtures("tf2")
def test_latest_pose_has_its_time() -> None:
    poses = TfPoses(None, "map", "base")
    matrix, stamp = poses.latest()
    assert (matrix[0, 3], stamp) == (2.0, 5 * SECOND)
    poses = TfPoses(None, "map", "arm")
    assert poses.latest() is None
    assert poses.waits_for == "no arm in map yet"
    known = history(limit=1)
    assert known.latest() is None
    known.add(pose(2, x=1.0))
    known.add(pose(3, x=4.0))
    matrix, stamp = known.latest()
    assert (matrix[0, 3], stamp) == (4.0, 3 * SECOND)


def test_error_names_tf_if_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tf2_ros", None)
    assert not has_tf()
    with pytest.raises(MissingPackageError, match=r"'tf' needs the package 'tf2_ros', .*install"):
        TfPoses(None, "map")
