# SPDX-License-Identifier: BSD-3-Clause
"""Poses and transforms of `geometry_msgs`, and matrices.

`matrix @ (x, y, z, 1)` transforms a point from the frame of the pose (the child frame of a
transform) to the frame of the message.
"""

import math
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import as_array

from ..errors import MessageError
from ._checks import check_fields, check_position
from ._packages import messages_of

if TYPE_CHECKING:
    from geometry_msgs.msg import Pose, Transform
    from scipy.spatial.transform import Rotation

Matrix: TypeAlias = npt.NDArray[np.float64]
"""(4, 4) rotation and translation [m]."""

NORM_TOLERANCE = 1e-2
"""Largest deviation of a quaternion's norm from 1; rounding errors are much smaller."""


def from_pose(message: Any) -> Matrix:
    """Return a pose as a (4, 4) matrix that transforms points [m] to the frame of the message.

    Args:
        message: a `Pose`, or a message with one as `pose`, such as `PoseStamped`,
            `PoseWithCovarianceStamped` and `Odometry`.
    """
    kind = "geometry_msgs/Pose, or one with a pose"
    return _from(message, "pose", kind, "position", "orientation")


def from_transform(message: Any) -> Matrix:
    """Return a `Transform` or `TransformStamped` as `from_pose` does, from the child frame."""
    return _from(message, "transform", "geometry_msgs/Transform", "translation", "rotation")


def to_pose(matrix: npt.ArrayLike) -> "Pose":
    """Return a (4, 4) matrix, a rotation and a translation [m], as a pose."""
    return _filled(messages_of("geometry_msgs").Pose(), "position", "orientation", matrix)


def to_transform(matrix: npt.ArrayLike) -> "Transform":
    """Return a (4, 4) matrix as a transform."""
    return _filled(messages_of("geometry_msgs").Transform(), "translation", "rotation", matrix)


def as_matrix(rotation: "Rotation", translation: npt.ArrayLike) -> Matrix:
    """Return a rotation and a translation (3,) as a (4, 4) matrix."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation.as_matrix()
    matrix[:3, 3] = translation
    return matrix


def _from(message: Any, inner: str, kind: str, place: str, turn: str) -> Matrix:
    """Return the matrix of the innermost message that messages hold under the name `inner`."""
    from scipy.spatial.transform import Rotation  # slow to import

    path = ""
    while hasattr(message, inner):
        message, path = getattr(message, inner), f"{path}{inner}."
    check_fields(message, kind, place, turn)
    position, orientation = getattr(message, place), getattr(message, turn)
    check_position(f"{path}{place}", position)
    quaternion = (orientation.x, orientation.y, orientation.z, orientation.w)
    if not abs(math.hypot(*quaternion) - 1.0) <= NORM_TOLERANCE:
        raise MessageError(f"{path}{turn}", "a quaternion of norm 1", quaternion)
    return as_matrix(Rotation.from_quat(quaternion), (position.x, position.y, position.z))


def _filled(message: Any, place: str, turn: str, matrix: npt.ArrayLike) -> Any:
    from scipy.spatial.transform import Rotation  # slow to import

    values = as_array(matrix, np.float64, "matrix")
    if values.shape != (4, 4) or not np.isfinite(values).all():
        raise MessageError("matrix", "4 x 4 finite numbers", matrix)
    turned = values[:3, :3]
    is_rotation = np.allclose(turned @ turned.T, np.eye(3), atol=NORM_TOLERANCE)
    if not (is_rotation and np.linalg.det(turned) > 0 and (values[3] == (0, 0, 0, 1)).all()):
        raise MessageError("matrix", "a rotation and a translation over (0, 0, 0, 1)", matrix)
    position, orientation = getattr(message, place), getattr(message, turn)
    position.x, position.y, position.z = values[:3, 3].tolist()
    quaternion = Rotation.from_matrix(turned).as_quat().tolist()
    orientation.x, orientation.y, orientation.z, orientation.w = quaternion
    return message
