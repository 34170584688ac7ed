# SPDX-License-Identifier: BSD-3-Clause
"""Poses of a robot and its sensors at the times of scans, from a topic or from tf2."""

import copy
import importlib.util
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.time import Time
from scipy.spatial.transform import Rotation, Slerp

from grid_map_core_py._packages import remedy_for
from grid_map_core_py.errors import GridMapError, MissingPackageError

from ..errors import MessageError
from ..messages._fields import NANOSECONDS, Matrix, as_matrix, from_pose, from_stamp, from_transform
from ._health import LogThrottle
from ._topics import listen

PACKAGE = "tf2_ros"

POSE_TYPES = {
    "odometry": Odometry,
    "pose": PoseStamped,
    "pose_with_covariance": PoseWithCovarianceStamped,
}
"""Message types of robot poses, by the names used in parameters."""

POSE_QUEUE = 100
"""Queue depth of pose subscriptions; large, because poses arrive faster than scans are fused."""

Covariance = npt.NDArray[np.float64]
"""(6, 6) covariance of x, y, z [m] and of the rotations about the axes x, y, z [rad]."""

LONGEST_JITTER = NANOSECONDS
"""Largest backward step in time that does not count as a time reset [ns]."""


@dataclass(frozen=True)
class Placement:
    """Poses of a scan and of the robot at the time of the scan.

    Attributes:
        transform: (4, 4) transform from the frame of the scan to the map frame.
        robot: (4, 4) transform from the robot frame to the map frame; None if unknown.
        center: (2,) position that the map follows [m], map frame; None if unknown.
        covariance: covariance of `transform`, map frame; None if unknown.
    """

    transform: Matrix
    robot: Matrix | None = None
    center: npt.NDArray[np.float64] | None = None
    covariance: Covariance | None = None


def frame_name(name: str) -> str:
    """Return a frame name without the leading slash, which ROS 1 allowed but tf2 rejects."""
    return name.removeprefix("/")


class Poses:
    """Pose source for scans that are already in the map frame; base class of other sources.

    All frame names may have a leading slash.
    """

    waits_for = ""  # pose or transform that was missing in the last call of `place`

    def __init__(self, map_frame: str) -> None:
        self.map_frame = frame_name(map_frame)

    def place(self, frame_id: str, stamp: int) -> Placement | None:  # noqa: ARG002
        """Return the placement of a scan, or None if the pose is not known yet.

        `stamp` is the time of the scan [ns]; 0 selects the latest pose.
        """
        if frame_name(frame_id) != self.map_frame:
            expected = f"{self.map_frame!r}, that of the map, as there are no poses"
            raise MessageError("header.frame_id", expected, frame_id)
        return Placement(np.eye(4))

    def frame_at(self, frame_id: str, stamp: int) -> Matrix | None:
        """Return the transform from a frame to the map frame, or None if it is not known yet."""
        placement = self.place(frame_id, stamp)
        return None if placement is None else placement.transform

    def go_back(self, stamp: int) -> None:
        """Discard outdated poses after a time reset to `stamp` [ns]."""


class PoseHistory(Poses):
    """Robot poses over time, with interpolation between poses.

    Args:
        sensor: (4, 4) transform from the frame of the scans to the robot frame.
        track_point: (3,) point that the map follows [m], robot frame.
        with_covariances: include the covariances of the poses in placements.

    Attributes:
        topic: function that returns a description of the pose topic, or "" if there is none.
    """

    def __init__(
        self,
        map_frame: str,
        sensor: Matrix | None = None,
        limit: int = 1000,
        track_point: npt.ArrayLike = (0.0, 0.0, 0.0),
        with_covariances: bool = False,
    ) -> None:
        super().__init__(map_frame)
        self._sensor = np.eye(4) if sensor is None else sensor
        self._limit = limit
        self._track_point = np.append(np.asarray(track_point, np.float64), 1.0)
        self._with_covariances = with_covariances
        self._stamps: list[int] = []
        self._poses: list[Matrix] = []
        self._covariances: list[Covariance | None] = []
        self.topic: Callable[[], str] = str

    @property
    def waits_for(self) -> str:  # type: ignore[override]
        topic, what = self.topic(), "poses"
        if self._stamps:
            what = f"a later pose than that of {_seconds(self._stamps[-1])}"
        return f"{what} on {topic}" if topic else what

    def mounted(self, sensor: Matrix) -> "PoseHistory":
        """Return a pose source with the same poses for another sensor."""
        other = copy.copy(self)
        other._sensor = sensor
        return other

    def add(self, message: Any) -> None:
        """Add the pose of an `Odometry`, `PoseStamped` or `PoseWithCovarianceStamped`.

        After a time reset (see `LONGEST_JITTER`), all stored poses are discarded first.
        """
        if frame_name(message.header.frame_id) != self.map_frame:
            expected = f"{self.map_frame!r}, that of the map"
            raise MessageError("header.frame_id", expected, message.header.frame_id)
        stamp = from_stamp(message.header.stamp)
        matrix = from_pose(message)
        given = getattr(message.pose, "covariance", None) if self._with_covariances else None
        covariance = None if given is None else np.reshape(given, (6, 6))
        if covariance is not None and not np.isfinite(covariance).all():
            raise MessageError("pose.covariance", "36 finite numbers", covariance.ravel().tolist())
        self.go_back(stamp)
        place = bisect_right(self._stamps, stamp)
        self._stamps.insert(place, stamp)
        self._poses.insert(place, matrix)
        self._covariances.insert(place, covariance)
        for values in (self._stamps, self._poses, self._covariances):
            del values[: -self._limit]

    def go_back(self, stamp: int) -> None:
        # The first pose after a reset may arrive before the first scan.
        if self._stamps and stamp < self._stamps[-1] - LONGEST_JITTER:
            for values in (self._stamps, self._poses, self._covariances):
                values.clear()

    def place(self, frame_id: str, stamp: int) -> Placement | None:
        robot = self.at(stamp)
        if robot is None:
            return None
        center = (robot @ self._track_point)[:2]
        if frame_name(frame_id) == self.map_frame:
            return Placement(np.eye(4), robot, center)
        transform = robot @ self._sensor
        covariance = carried(self.covariance_at(stamp), transform[:3, 3] - robot[:3, 3])
        return Placement(transform, robot, center, covariance)

    def frame_at(self, frame_id: str, stamp: int) -> Matrix | None:
        return np.eye(4) if frame_name(frame_id) == self.map_frame else self.at(stamp)

    def latest(self) -> tuple[Matrix, int] | None:
        return (self._poses[-1], self._stamps[-1]) if self._stamps else None

    def at(self, stamp: int) -> Matrix | None:
        """Return the robot pose at the time `stamp` [ns], or None if it is not known yet.

        If `stamp` is 0, return the latest pose. If all poses are later, raise `GridMapError`.
        """
        if not self._stamps or stamp > self._stamps[-1]:
            return None
        if stamp and stamp < self._stamps[0]:
            first = _seconds(self._stamps[0])
            text = f"no pose at {_seconds(stamp)}: the first one is of {first}"
            is_far = self._stamps[0] - stamp > 10 * NANOSECONDS
            raise GridMapError(text + "; do scans and poses have the same clock?" * is_far)
        before, after, share = self._around(stamp)
        begin, end = self._poses[before], self._poses[after]
        return end if before == after else between(begin, end, share)

    def covariance_at(self, stamp: int) -> Covariance | None:
        """Return the pose covariance at the time `stamp` [ns] (0: latest), or None if unknown."""
        if not self._stamps:
            return None
        before, after, share = self._around(stamp)
        begin, end = self._covariances[before], self._covariances[after]
        if before == after or begin is None or end is None:
            return end
        return (1 - share) * begin + share * end

    def _around(self, stamp: int) -> tuple[int, int, float]:
        """Return the indices of the poses before and after a time, and the weight of the second."""
        last = len(self._stamps) - 1
        after = min(bisect_left(self._stamps, stamp), last) if stamp else last
        if after == 0 or stamp == 0 or stamp >= self._stamps[after]:
            return after, after, 0.0
        begin, end = self._stamps[after - 1], self._stamps[after]
        return after - 1, after, (stamp - begin) / (end - begin)


def carried(covariance: Covariance | None, lever: npt.ArrayLike) -> Covariance | None:
    """Propagate the covariance of the robot pose to the pose of a sensor.

    `lever` (3,) is the vector from the robot to the sensor [m], map frame. An error `dtheta` of the
    robot rotation adds `dtheta x lever` to the error of the sensor position.
    """
    if covariance is None:
        return None
    x, y, z = np.asarray(lever, np.float64)
    jacobian = np.eye(6)
    jacobian[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    # The mapper rejects a result that is not finite.
    with np.errstate(over="ignore", invalid="ignore"):
        result = jacobian @ covariance @ jacobian.T
        return 0.5 * (result + result.T)


def check_optical_frame(frame_id: str, placement: Placement) -> None:
    """Raise a `GridMapError` if the z axis of an optical frame points up instead of forward."""
    if placement.robot is None:
        return
    rotation = placement.transform[:3, :3]
    turn = placement.robot[:3, :3].T @ rotation
    # A rotation by 18 degrees has this trace.
    if np.trace(turn) > 2.9 and rotation[2, 2] > 0.9:
        raise GridMapError(
            f"header.frame_id: expected an optical frame with z forward, got {frame_id!r} with z "
            "up. Publish its transform with roll -1.5708, pitch 0 and yaw -1.5708 to the body of "
            "the camera; without tf, turn sensor_rpy likewise"
        )


def from_xyz_rpy(xyz: npt.ArrayLike, rpy: npt.ArrayLike) -> Matrix:
    """Return the transform for x, y, z [m] and roll, pitch, yaw [rad], as in URDF (fixed axes)."""
    return as_matrix(Rotation.from_euler("xyz", np.asarray(rpy, np.float64)), xyz)


def between(begin: Matrix, end: Matrix, share: float) -> Matrix:
    """Interpolate between two poses: positions linearly, rotations with slerp."""
    turn = Slerp([0.0, 1.0], Rotation.from_matrix([begin[:3, :3], end[:3, :3]]))
    return as_matrix(turn(share), (1 - share) * begin[:3, 3] + share * end[:3, 3])


def _seconds(stamp: int) -> str:
    return f"{stamp / NANOSECONDS:.3f} s"


def has_tf() -> bool:
    return importlib.util.find_spec(PACKAGE) is not None


def chosen_source(name: str, without_tf: str) -> str:
    """Replace the pose source `auto` with `tf` or, if tf2 is missing, with `without_tf`."""
    if name == "auto":
        return "tf" if has_tf() else without_tf
    return name


def subscribe_to_poses(
    node: Node,
    message_type: type,
    topic: str,
    history: PoseHistory,
    then: Callable[[], object],
    log: LogThrottle,
    depth: int = 1,
) -> None:
    """Add the poses of a topic to `history`, and call `then` after each pose."""

    def add(message: Any) -> None:
        history.add(message)
        then()

    describe = listen(node, message_type, topic, add, log, "a pose", depth)
    remedy = "" if has_tf() else "; without tf2_ros_py, pose_source 'auto' means this topic"
    history.topic = lambda: describe() + remedy


class TfPoses(Poses):
    """Pose source that looks up transforms in tf2.

    Args:
        robot_frame: frame of the robot; empty means the frame of the scan.
        track_frame: frame of `track_point`; empty means the robot frame.
        track_point: (3,) point that the map follows [m], in `track_frame`.
        covariances: history that provides the pose covariances; None means no covariances.
    """

    def __init__(
        self,
        node: Node,
        map_frame: str,
        robot_frame: str = "",
        *,
        track_frame: str = "",
        track_point: npt.ArrayLike = (0.0, 0.0, 0.0),
        covariances: PoseHistory | None = None,
    ) -> None:
        if not has_tf():
            remedy = f"{remedy_for('tf2_ros')}, or take another pose_source"
            raise MissingPackageError(PACKAGE, "pose_source 'tf'", remedy)
        super().__init__(map_frame)
        import tf2_ros

        self._tf: Any = tf2_ros
        self._robot_frame, self._track_frame = robot_frame, track_frame
        self._track_point = np.append(np.asarray(track_point, np.float64), 1.0)
        self._covariances = covariances
        self._buffer = self._tf.Buffer()
        self._listener = self._tf.TransformListener(self._buffer, node)
        self.waits_for = "transforms"

    def place(self, frame_id: str, stamp: int) -> Placement | None:
        robot_frame = self._robot_frame or frame_id
        found = []
        for frame in (frame_id, robot_frame, self._track_frame or robot_frame):
            matrix = self.frame_at(frame, stamp)
            if matrix is None:
                return None
            found.append(matrix)
        transform, robot, tracked = found
        center, covariance = (tracked @ self._track_point)[:2], None
        if self._covariances is not None:
            covariance = self._covariances.covariance_at(stamp)
            if covariance is None:
                self.waits_for = self._covariances.waits_for
                return None
            covariance = carried(covariance, transform[:3, 3] - robot[:3, 3])
        return Placement(transform, robot, center, covariance)

    def frame_at(self, frame_id: str, stamp: int) -> Matrix | None:
        found = self._look_up(frame_id, stamp)
        return None if found is None else from_transform(found)

    def latest(self) -> tuple[Matrix, int] | None:
        """Return the latest robot pose and its time [ns] (0 if static), or None if unknown."""
        found = self._look_up(self._robot_frame, 0)
        return None if found is None else (from_transform(found), from_stamp(found.header.stamp))

    def _look_up(self, frame_id: str, stamp: int) -> Any:
        time = Time(nanoseconds=stamp)
        try:
            return self._buffer.lookup_transform(self.map_frame, frame_name(frame_id), time)
        except self._tf.TransformException as error:
            # tf2 cannot tell whether the transform will become available.
            self.waits_for = str(error)
            return None

    def go_back(self, _stamp: int) -> None:
        # tf2 ignores older transforms until its buffer is cleared; static transforms stay.
        self._buffer.clear()
