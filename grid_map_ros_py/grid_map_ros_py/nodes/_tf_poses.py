# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Poses from tf2, where it is installed."""

import importlib
import importlib.util
from typing import Any

from rclpy.node import Node
from rclpy.time import Time

from grid_map_core_py.errors import MissingPackageError

from .._mapping.poses import Placement, Poses
from ..messages._pose import Matrix, from_transform

PACKAGE = "tf2_ros"


def has_tf() -> bool:
    """Return whether tf2 can be imported."""
    return importlib.util.find_spec(PACKAGE) is not None


class TfPoses(Poses):
    """Source of poses that looks them up in the tree of transforms.

    Args:
        node: node that subscribes to `/tf` and `/tf_static`.
        map_frame: frame of the map.
        robot_frame: frame of the robot; empty for the frame of the cloud.

    Raises:
        MissingPackageError: tf2 is not installed.
    """

    def __init__(self, node: Node, map_frame: str, robot_frame: str = "") -> None:
        if not has_tf():
            remedy = "install tf2_ros_py of your ROS distribution, or take another pose_source"
            raise MissingPackageError(PACKAGE, "pose_source 'tf'", remedy)
        super().__init__(map_frame)
        self._tf: Any = importlib.import_module(PACKAGE)
        self._robot_frame = robot_frame
        self._buffer = self._tf.Buffer()
        self._listener = self._tf.TransformListener(self._buffer, node)
        self.waits_for = "transforms"

    def place(self, frame_id: str, stamp: int) -> Placement | None:
        """Return the placement of a cloud; None while tf2 does not know it."""
        try:
            transform = self._look_up(frame_id, stamp)
            robot = self._look_up(self._robot_frame or frame_id, stamp)
        except self._tf.TransformException as error:
            # tf2 cannot tell whether the transform will become available.
            self.waits_for = str(error)
            return None
        return Placement(transform, robot[:2, 3])

    def _look_up(self, frame_id: str, stamp: int) -> Matrix:
        time = Time(nanoseconds=stamp)
        return from_transform(self._buffer.lookup_transform(self._map_frame, frame_id, time))
