# SPDX-License-Identifier: BSD-3-Clause
"""Poses of a robot and its sensors at the times of scans."""

import copy
from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, Slerp

from grid_map_core_py.errors import GridMapError

from ..errors import MessageError
from ..messages._pose import Matrix, as_matrix, from_pose
from ..messages._time import NANOSECONDS, from_stamp

Covariance = npt.NDArray[np.float64]
"""(6, 6) covariance of x, y, z [m] and of the rotations about the axes x, y, z [rad]."""

LONGEST_JITTER = NANOSECONDS
"""Time [ns] by which a scan or a pose may be earlier than the one before without a reset."""

INDEFINITE = 1e-6
"""Largest deviation of a covariance from a symmetric, positive semi-definite one, relative."""


@dataclass(frozen=True)
class Placement:
    """Pose of a scan and of the robot.

    Attributes:
        transform: from the frame of the scan to the frame of the map.
        robot: from the frame of the robot to the frame of the map; None if unknown.
        center: (2,) x, y that the map follows [m], map frame; None if unknown.
        covariance: of the pose `transform`, map frame; None if unknown.
    """

    transform: Matrix
    robot: Matrix | None = None
    center: npt.NDArray[np.float64] | None = None
    covariance: Covariance | None = None


class Poses:
    """Source of poses; this one is for scans that are in the frame of the map already.

    Attributes:
        waits_for: name of the missing pose or transform after `place` has returned None.
    """

    waits_for = ""

    def __init__(self, map_frame: str) -> None:
        self._map_frame = map_frame

    def place(self, frame_id: str, _stamp: int) -> Placement | None:
        """Return the placement of a scan of that frame and time [ns], or None if not known yet.

        Time 0 stands for the latest pose.

        Raises:
            GridMapError: the placement will never be known.
        """
        if frame_id != self._map_frame:
            expected = f"{self._map_frame!r}, that of the map, as there are no poses"
            raise MessageError("header.frame_id", expected, frame_id)
        return Placement(np.eye(4))

    def frame_at(self, frame_id: str, stamp: int) -> Matrix | None:
        """Return the transform from a frame of the robot to the map; None if not known yet.

        Errors and time 0: see `place`.
        """
        placement = self.place(frame_id, stamp)
        return None if placement is None else placement.transform

    def go_back(self, stamp: int) -> None:
        """Forget later poses, as time has gone back to `stamp` [ns]."""


class PoseHistory(Poses):
    """Poses of a robot over time; poses in between are interpolated.

    Args:
        map_frame: frame of the poses.
        sensor: transform from the frame of the scans to the frame of the robot.
        limit: maximum number of poses that are kept.
        track_point: (3,) point that the map follows [m], frame of the robot.
        with_covariances: whether the covariances of the poses are used, and checked.
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

    @property
    def waits_for(self) -> str:  # type: ignore[override]
        """Name of the pose that comes next."""
        if not self._stamps:
            return "poses"
        return f"a later pose than that of {_seconds(self._stamps[-1])}"

    def mounted(self, sensor: Matrix) -> "PoseHistory":
        """Return the same poses, also those that are added later, for another sensor."""
        other = copy.copy(self)
        other._sensor = sensor
        return other

    def add(self, message: Any) -> None:
        """Add a pose: `Odometry`, `PoseStamped` or `PoseWithCovarianceStamped`.

        A pose that is more than `LONGEST_JITTER` earlier than the last one means that time was
        reset: older poses are forgotten.

        Raises:
            MessageError: the pose is in another frame, or its numbers are invalid.
        """
        if message.header.frame_id.removeprefix("/") != self._map_frame:
            expected = f"{self._map_frame!r}, that of the map"
            raise MessageError("header.frame_id", expected, message.header.frame_id)
        stamp = from_stamp(message.header.stamp)
        matrix = from_pose(message)
        given = getattr(message.pose, "covariance", None) if self._with_covariances else None
        covariance = None if given is None else from_covariance(given)
        self.go_back(stamp)
        place = bisect_right(self._stamps, stamp)
        self._stamps.insert(place, stamp)
        self._poses.insert(place, matrix)
        self._covariances.insert(place, covariance)
        self._forget(len(self._stamps) - self._limit)

    def go_back(self, stamp: int) -> None:
        # The poses may have gone back before the scans.
        if self._stamps and stamp < self._stamps[-1] - LONGEST_JITTER:
            self._forget(len(self._stamps))

    def _forget(self, count: int) -> None:
        for values in (self._stamps, self._poses, self._covariances):
            del values[: max(count, 0)]

    def place(self, frame_id: str, stamp: int) -> Placement | None:
        """Return the placement of a scan; None if it is newer than the last pose."""
        robot = self.at(stamp)
        if robot is None:
            return None
        center = (robot @ self._track_point)[:2]
        if frame_id == self._map_frame:
            return Placement(np.eye(4), robot, center)
        transform = robot @ self._sensor
        covariance = carried(self.covariance_at(stamp), transform[:3, 3] - robot[:3, 3])
        return Placement(transform, robot, center, covariance)

    def frame_at(self, frame_id: str, stamp: int) -> Matrix | None:
        """Return the pose of the robot, which stands for all of its frames."""
        return np.eye(4) if frame_id == self._map_frame else self.at(stamp)

    def latest(self) -> tuple[Matrix, int] | None:
        """Return the latest pose and its time [ns]; None before the first."""
        return (self._poses[-1], self._stamps[-1]) if self._stamps else None

    def at(self, stamp: int) -> Matrix | None:
        """Return the pose at a time [ns], 0 for the latest; None if the time is in the future.

        Raises:
            GridMapError: the time is earlier than all poses that are kept.
        """
        if not self._stamps or stamp > self._stamps[-1]:
            return None
        if stamp and stamp < self._stamps[0]:
            first = _seconds(self._stamps[0])
            raise GridMapError(f"no pose at {_seconds(stamp)}: the first one is of {first}")
        before, after, share = self._around(stamp)
        begin, end = self._poses[before], self._poses[after]
        return end if before == after else between(begin, end, share)

    def covariance_at(self, stamp: int) -> Covariance | None:
        """Return the covariance of the pose at a time [ns], 0 for the latest; None if unknown.

        Between two poses it is interpolated, before the first and after the last it is theirs.
        """
        if not self._stamps:
            return None
        before, after, share = self._around(stamp)
        begin, end = self._covariances[before], self._covariances[after]
        if before == after or begin is None or end is None:
            return end
        return (1 - share) * begin + share * end

    def _around(self, stamp: int) -> tuple[int, int, float]:
        """Return the numbers of the poses around a time, and its share of the way between them."""
        last = len(self._stamps) - 1
        after = min(bisect_left(self._stamps, stamp), last) if stamp else last
        if after == 0 or stamp == 0 or stamp >= self._stamps[after]:
            return after, after, 0.0
        begin, end = self._stamps[after - 1], self._stamps[after]
        return after - 1, after, (stamp - begin) / (end - begin)


def from_covariance(values: npt.ArrayLike) -> Covariance:
    """Return the covariance (36,) of a message as a matrix (6, 6).

    Raises:
        MessageError: it is not finite, not symmetric, or not positive semi-definite.
    """
    matrix = np.asarray(values, np.float64).reshape(6, 6)
    expected = "36 numbers of a symmetric, positive semi-definite matrix"
    with np.errstate(over="ignore", invalid="ignore"):
        largest = float(np.abs(matrix).max())
        is_symmetric = np.abs(matrix - matrix.T).max() <= INDEFINITE * largest
    if not (np.isfinite(largest) and is_symmetric):
        raise MessageError("pose.covariance", expected, matrix.ravel().tolist())
    matrix = 0.5 * (matrix + matrix.T)
    if largest == 0.0:
        return matrix
    eigenvalues, vectors = np.linalg.eigh(matrix / largest)
    if eigenvalues[0] < -INDEFINITE:
        raise MessageError("pose.covariance", expected, matrix.ravel().tolist())
    # What is left of rounding errors of the sender.
    if eigenvalues[0] < 0.0:
        matrix = largest * ((vectors * np.maximum(eigenvalues, 0.0)) @ vectors.T)
    return 0.5 * (matrix + matrix.T)


def carried(covariance: Covariance | None, lever: npt.ArrayLike) -> Covariance | None:
    """Return the covariance of a sensor's pose from that of the robot's.

    The sensor is at `lever` (3,) from the robot [m], in the axes of the map. Its position also
    varies with the rotation of the robot: `d = dp + dtheta x lever`.
    """
    if covariance is None:
        return None
    x, y, z = np.asarray(lever, np.float64)
    jacobian = np.eye(6)
    jacobian[:3, 3:] = [[0, z, -y], [-z, 0, x], [y, -x, 0]]
    result = jacobian @ covariance @ jacobian.T
    return 0.5 * (result + result.T)


def from_xyz_rpy(xyz: npt.ArrayLike, rpy: npt.ArrayLike) -> Matrix:
    """Return the transform of x, y, z [m] and roll, pitch, yaw [rad] as in URDF (fixed axes)."""
    return as_matrix(Rotation.from_euler("xyz", np.asarray(rpy, np.float64)), xyz)


def between(begin: Matrix, end: Matrix, share: float) -> Matrix:
    """Return the pose interpolated between two others: linear in position, slerp in rotation."""
    turn = Slerp([0.0, 1.0], Rotation.from_matrix([begin[:3, :3], end[:3, :3]]))
    return as_matrix(turn(share), (1 - share) * begin[:3, 3] + share * end[:3, 3])


def _seconds(stamp: int) -> str:
    return f"{stamp / NANOSECONDS:.3f} s"
