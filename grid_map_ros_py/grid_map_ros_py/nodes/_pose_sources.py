# SPDX-License-Identifier: BSD-3-Clause
"""Sources of poses that nodes offer by name, and tf2, where it is installed."""

import importlib
import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.time import Time

from grid_map_core_py.errors import MissingPackageError

from ..messages._pose import Matrix, from_transform
from ..messages._time import from_stamp
from ._logs import LogThrottle
from ._poses import Placement, PoseHistory, Poses, carried
from ._topics import listen

PACKAGE = "tf2_ros"

POSE_TYPES = {
    "odometry": Odometry,
    "pose": PoseStamped,
    "pose_with_covariance": PoseWithCovarianceStamped,
}
"""Types of messages with poses of a robot, by their names in parameters."""

POSE_QUEUE = 100
"""Depth of a subscription to poses, which arrive faster than scans are fused."""


def has_tf() -> bool:
    """Return whether tf2 can be imported."""
    return importlib.util.find_spec(PACKAGE) is not None


def chosen_source(name: str, without_tf: str) -> str:
    """Return the source of poses for a parameter: `auto` is tf, or another one without tf2."""
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
    """Add the poses of a topic to a history, and call `then` after each of them."""

    def add(message: Any) -> None:
        history.add(message)
        then()

    listen(node, message_type, topic, add, log, "a pose", depth)


class TfPoses(Poses):
    """Source of poses that looks them up in the tree of transforms.

    Args:
        node: node that subscribes to `/tf` and `/tf_static`.
        map_frame: frame of the map.
        robot_frame: frame of the robot; empty for the frame of the scan.
        track_frame: frame of the track point; empty for that of the robot.
        track_point: (3,) point that the map follows [m], in that frame.
        covariances: poses of the robot whose covariances are used; None for none.
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
            remedy = "install tf2_ros_py of your ROS distribution, or take another pose_source"
            raise MissingPackageError(PACKAGE, "pose_source 'tf'", remedy)
        super().__init__(map_frame)
        self._tf: Any = importlib.import_module(PACKAGE)
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
        """Return the latest pose of the robot and its time [ns], 0 if it is static."""
        found = self._look_up(self._robot_frame, 0)
        return None if found is None else (from_transform(found), from_stamp(found.header.stamp))

    def _look_up(self, frame_id: str, stamp: int) -> Any:
        time = Time(nanoseconds=stamp)
        try:
            return self._buffer.lookup_transform(self._map_frame, frame_id, time)
        except self._tf.TransformException as error:
            # tf2 cannot tell whether the transform will become available.
            self.waits_for = str(error)
            return None

    def go_back(self, _stamp: int) -> None:
        # tf2 refuses transforms earlier than those it has; those of `/tf_static` stay.
        self._buffer.clear()
