# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Poses of a robot and its sensor at the times of clouds."""

from bisect import bisect_left
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation, Slerp

from grid_map_core_py.errors import GridMapError

from ..errors import MessageError
from ..messages._pose import Matrix, as_matrix, from_pose
from ..messages._time import NANOSECONDS, from_stamp


@dataclass(frozen=True)
class Placement:
    """Pose of a cloud and position of the robot.

    Attributes:
        transform: from the frame of the cloud to the frame of the map.
        center: (2,) x, y of the robot [m], map frame; None if unknown.
    """

    transform: Matrix
    center: npt.NDArray[np.float64] | None


class Poses:
    """Source of poses; this one is for clouds that are in the frame of the map already.

    Attributes:
        waits_for: name of the missing pose or transform after `place` has returned None.
    """

    waits_for = ""

    def __init__(self, map_frame: str) -> None:
        self._map_frame = map_frame

    def place(self, frame_id: str, _stamp: int) -> Placement | None:
        """Return the placement of a cloud of that frame and time [ns], or None if not known yet.

        Time 0 stands for the latest pose.

        Raises:
            GridMapError: the placement will never be known.
        """
        if frame_id != self._map_frame:
            expected = f"{self._map_frame!r}, that of the map, as there are no poses"
            raise MessageError("header.frame_id", expected, frame_id)
        return Placement(np.eye(4), None)


class PoseHistory(Poses):
    """Poses of a robot over time; poses in between are interpolated.

    Args:
        map_frame: frame of the poses.
        sensor: transform from the frame of the clouds to the frame of the robot.
        limit: maximum number of poses that are kept.
    """

    def __init__(self, map_frame: str, sensor: Matrix | None = None, limit: int = 1000) -> None:
        super().__init__(map_frame)
        self.waits_for = "poses"
        self._sensor = np.eye(4) if sensor is None else sensor
        self._limit = limit
        self._stamps: list[int] = []
        self._poses: list[Matrix] = []

    def add(self, message: Any) -> None:
        """Add a pose: `Odometry`, `PoseStamped` or `PoseWithCovarianceStamped`.

        A pose earlier than the last one means that time was reset: older poses are forgotten.

        Raises:
            MessageError: the pose is in another frame, or its numbers are invalid.
        """
        if message.header.frame_id != self._map_frame:
            expected = f"{self._map_frame!r}, that of the map"
            raise MessageError("header.frame_id", expected, message.header.frame_id)
        stamp = from_stamp(message.header.stamp)
        matrix = from_pose(message)
        if self._stamps and stamp < self._stamps[-1]:
            self._stamps, self._poses = [], []
        self._stamps.append(stamp)
        self._poses.append(matrix)
        if len(self._stamps) > self._limit:
            del self._stamps[0], self._poses[0]
        self.waits_for = f"a later pose than that of {_seconds(stamp)}"

    def place(self, frame_id: str, stamp: int) -> Placement | None:
        """Return the placement of a cloud; None if it is newer than the last pose."""
        robot = self.at(stamp)
        if robot is None:
            return None
        is_there = frame_id == self._map_frame
        return Placement(np.eye(4) if is_there else robot @ self._sensor, robot[:2, 3])

    def at(self, stamp: int) -> Matrix | None:
        """Return the pose at a time [ns], 0 for the latest; None if the time is in the future.

        Raises:
            GridMapError: the time is earlier than all poses that are kept.
        """
        if not self._stamps or stamp > self._stamps[-1]:
            return None
        if stamp == 0:
            return self._poses[-1]
        after = bisect_left(self._stamps, stamp)
        if self._stamps[after] == stamp:
            return self._poses[after]
        if after == 0:
            first = _seconds(self._stamps[0])
            raise GridMapError(f"no pose at {_seconds(stamp)}: the first one is of {first}")
        begin, end = self._stamps[after - 1], self._stamps[after]
        share = (stamp - begin) / (end - begin)
        return between(self._poses[after - 1], self._poses[after], share)


def from_xyz_rpy(xyz: npt.ArrayLike, rpy: npt.ArrayLike) -> Matrix:
    """Return the transform of x, y, z [m] and roll, pitch, yaw [rad] as in URDF (fixed axes)."""
    return as_matrix(Rotation.from_euler("xyz", np.asarray(rpy, np.float64)), xyz)


def between(begin: Matrix, end: Matrix, share: float) -> Matrix:
    """Return the pose interpolated between two others: linear in position, slerp in rotation."""
    turn = Slerp([0.0, 1.0], Rotation.from_matrix([begin[:3, :3], end[:3, :3]]))
    return as_matrix(turn(share), (1 - share) * begin[:3, 3] + share * end[:3, 3])


def _seconds(stamp: int) -> str:
    return f"{stamp / NANOSECONDS:.3f} s"
