# SPDX-License-Identifier: BSD-3-Clause
import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    PoseWithCovarianceStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from hypothesis import given, strategies as st
from nav_msgs.msg import Odometry
from wire import over_the_wire, set_field

from grid_map_ros_py import MessageError, from_pose, from_transform, to_pose, to_transform

HALF = math.sqrt(0.5)
QUARTER_TURN = Quaternion(z=HALF, w=HALF)
POSE = Pose(position=Point(x=1.0, y=2.0, z=3.0), orientation=QUARTER_TURN)
TRANSFORM = Transform(translation=Vector3(x=1.0, y=2.0, z=3.0), rotation=QUARTER_TURN)
MATRIX = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    ("read", "message", "path", "part"),
    [
        (from_pose, PoseStamped(), "pose", POSE),
        (from_pose, PoseWithCovarianceStamped(), "pose.pose", POSE),
        (from_pose, Odometry(), "pose.pose", POSE),
        (from_transform, TransformStamped(), "transform", TRANSFORM),
    ],
)
def test_quarter_turn_is_known(read: Any, message: Any, path: str, part: Any) -> None:
    set_field(message, path, part)
    for one in (part, message):
        np.testing.assert_allclose(read(one), MATRIX, atol=1e-15)


def test_rounded_quaternion_is_accepted() -> None:
    matrix = from_pose(Pose(orientation=Quaternion(z=0.7071, w=0.7071)))
    np.testing.assert_allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-12)


numbers = st.floats(-1e6, 1e6)
quaternions = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.1)


@given(st.tuples(numbers, numbers, numbers), quaternions)
def test_matrix_round_trips_through_messages(
    place: tuple[float, ...], turn: tuple[float, ...]
) -> None:
    x, y, z, w = (value / math.hypot(*turn) for value in turn)
    pose = Pose(position=Point(**dict(zip("xyz", place, strict=True))))
    pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    matrix = from_pose(pose)
    # A quaternion turns a vector v into q v q*, here written out for the x axis.
    expected = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
    np.testing.assert_allclose(matrix[:3, 0], expected, atol=1e-12)
    assert matrix[:3, 3].tolist() == [*place]
    for back in (
        from_pose(over_the_wire(to_pose(matrix))),
        from_transform(over_the_wire(to_transform(matrix))),
    ):
        np.testing.assert_allclose(back, matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("read", "message", "path", "value", "text"),
    [
        (from_pose, PoseStamped(), "pose.position.y", math.nan, r"pose\.position\.y: .*got nan"),
        (from_pose, Pose(), "orientation.w", 2.0, r"^orientation: expected a quaternion of norm 1"),
        (from_pose, Pose(), "orientation.w", 1e200, r"^orientation: expected a quaternion"),
        (from_pose, Odometry(), "pose.pose.orientation.w", 0.0, r"^pose\.pose\.orientation: "),
        (from_transform, Transform(), "translation.x", math.inf, r"^translation\.x: .*got inf"),
        (from_transform, TransformStamped(), "transform.rotation.x", math.nan, "rotation: .*norm"),
    ],
)
def test_invalid_pose_gets_one_error_that_names_the_field(
    read: Any, message: Any, path: str, value: float, text: str
) -> None:
    set_field(message, path, value)
    with pytest.raises(MessageError, match=text):
        read(message)


@pytest.mark.parametrize("write", [to_pose, to_transform])
@pytest.mark.parametrize(
    ("matrix", "expected"),
    [
        (np.eye(3), "4 x 4 finite numbers"),
        (np.full((4, 4), math.nan), "4 x 4 finite numbers"),
        (2.0 * np.eye(4), "a rotation and a translation"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "a rotation and a translation"),
        (np.ones((4, 4)), "a rotation and a translation"),
    ],
)
def test_other_matrices_are_refused(write: Any, matrix: Any, expected: str) -> None:
    with pytest.raises(MessageError, match=f"matrix: expected {expected}"):
        write(matrix)


def test_transform_is_no_pose() -> None:
    with pytest.raises(MessageError, match=r"message: expected a geometry_msgs/Pose.*Transform'"):
        from_pose(TRANSFORM)
    with pytest.raises(MessageError, match=r"message: expected a geometry_msgs/Transform.*Pose'"):
        from_transform(POSE)
