# SPDX-License-Identifier: BSD-3-Clause
"""Uncertain poses: variances of heights by the pose of the sensor, and by its motion."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import as_array
from ..errors import GeometryError, short

_TOLERANCE = 1e-6
"""Tolerance of symmetry and of negative eigenvalues, relative to the largest element."""

_HEIGHT_AND_TILT, _LEVEL = np.array([2, 3, 4]), np.array([0, 1, 5])
"""Places of z, roll and pitch, and of the others, among x, y, z, roll, pitch, yaw."""


@dataclass(frozen=True)
class Covariance:
    """Covariance of the pose of a sensor; rotations are about the map axes.

    Attributes:
        matrix: (3, 3) of z [m], roll and pitch [rad]: height and tilt.
        level: (3, 3) of x, y [m] and yaw [rad].
    """

    matrix: NDArray[np.float64]
    level: NDArray[np.float64]

    def of_points(self, x: Any, y: Any) -> Any:
        """Return the variance of z [m^2] that the pose gives to points.

        It is `J_q Q J_q^T` with J_q = (y, -x), plus the variance of z: a rotation by (roll, pitch)
        about the sensor lifts a point by `roll * y - pitch * x`.

        Args:
            x, y: places relative to the sensor [m], map frame.
        """
        (height, _, _), (_, roll, both), (_, _, pitch) = self.matrix.tolist()
        return height + (roll * y * y - 2.0 * both * x * y + pitch * x * x)

    def with_height(self, variance: float) -> Covariance:
        """Return the covariance with another variance of z [m^2]."""
        matrix = self.matrix.copy()
        matrix[0, 0] = variance
        return replace(self, matrix=matrix)

    def of_places(self, x: Any, y: Any) -> Any:
        """Return the same for cells, correlations of height and tilt included."""
        _, with_roll, with_pitch = self.matrix[0].tolist()
        return self.of_points(x, y) + 2.0 * (with_roll * y - with_pitch * x)

    def level_of_places(self, x: Any, y: Any) -> Any:
        """Return the mean of the variances of x and y [m^2]: yaw turns a place by (-y, x)."""
        (along_x, _, x_yaw), (_, along_y, y_yaw), (_, _, yaw) = self.level.tolist()
        return 0.5 * (along_x + along_y + yaw * (x * x + y * y)) + y_yaw * x - x_yaw * y

    def level_of_points(self, x: Any, y: Any, z: Any) -> Any:
        """Return the same for points at a height z relative to the sensor, tilt included."""
        tilt = 0.5 * float(self.matrix[1, 1] + self.matrix[2, 2])
        return self.level_of_places(x, y) + tilt * z * z


def as_covariance(values: ArrayLike | None, name: str = "pose_covariance") -> Covariance | None:
    """Return the height and tilt of the covariance of a pose (6, 6), or None.

    Raises:
        GeometryError: it has another shape, or is not symmetric, finite and positive semi-definite.
    """
    if values is None:
        return None
    matrix: NDArray[np.float64] = as_array(values, np.float64, name)
    if matrix.shape != (6, 6) or not np.isfinite(matrix).all():
        raise GeometryError(f"{name}: expected (6, 6) finite numbers, got {short(values)}")
    scale = float(np.abs(matrix).max()) or 1.0
    scaled = matrix / scale
    if np.abs(scaled - scaled.T).max() > _TOLERANCE:
        raise GeometryError(f"{name}: expected a symmetric matrix, got {matrix.tolist()}")
    least = np.linalg.eigvalsh(scaled).min()
    if least < -_TOLERANCE:
        raise GeometryError(
            f"{name}: expected a positive semi-definite matrix, got the eigenvalue "
            f"{least * scale:g}"
        )
    matrix = 0.5 * (matrix + matrix.T)
    blocks = (matrix[np.ix_(places, places)] for places in (_HEIGHT_AND_TILT, _LEVEL))
    return Covariance(*blocks)


def of_motion(old: Covariance, new: Covariance, dx: float, dy: float) -> Covariance:
    """Return the covariance that the motion from one pose to the next has added.

    The old uncertainty moves along: a tilt lifts the sensor by `roll * dy - pitch * dx`. Where the
    new pose is more certain than that, nothing is added.

    Args:
        old, new: covariances of both poses.
        dx, dy: motion of the sensor [m], map frame.
    """
    tilt = np.array([[1.0, dy, -dx], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    turn = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    return Covariance(_added(old.matrix, new.matrix, tilt), _added(old.level, new.level, turn))


def _added(
    old: NDArray[np.float64], new: NDArray[np.float64], moved: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return `new - moved @ old @ moved.T` without its negative part."""
    scale = max(float(np.abs(old).max()), float(np.abs(new).max())) or 1.0
    added = new / scale - moved @ (old / scale) @ moved.T
    values, vectors = np.linalg.eigh(0.5 * (added + added.T))
    with np.errstate(over="ignore"):
        result: NDArray[np.float64] = (vectors * np.maximum(values, 0.0)) @ vectors.T * scale
    return result
