# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Uncertain poses: variances of heights by the pose of the sensor, and by its motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays._checks import as_array
from ..errors import GeometryError, short

_TOLERANCE = 1e-6
"""Tolerance of symmetry and of negative eigenvalues, relative to the largest element."""

_HEIGHT_AND_TILT = np.array([2, 3, 4])
"""Places of z, roll and pitch among x, y, z, roll, pitch, yaw."""


@dataclass(frozen=True)
class Covariance:
    """Covariance of the height and the tilt of a sensor; rotations are about the map axes.

    Attributes:
        matrix: (3, 3) of z [m], roll and pitch [rad].
    """

    matrix: NDArray[np.float64]

    def of_points(self, x: Any, y: Any) -> Any:
        """Return the variance of z [m^2] that the pose gives to points.

        It is `J_q Q J_q^T` with J_q = (y, -x), plus the variance of z: a rotation by (roll, pitch)
        about the sensor lifts a point by `roll * y - pitch * x`.

        Args:
            x, y: places relative to the sensor [m], map frame.
        """
        (height, _, _), (_, roll, both), (_, _, pitch) = self.matrix.tolist()
        return height + (roll * y * y - 2.0 * both * x * y + pitch * x * x)

    def of_places(self, x: Any, y: Any) -> Any:
        """Return the same for cells, correlations of height and tilt included."""
        _, with_roll, with_pitch = self.matrix[0].tolist()
        return self.of_points(x, y) + 2.0 * (with_roll * y - with_pitch * x)


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
    return Covariance(matrix[np.ix_(_HEIGHT_AND_TILT, _HEIGHT_AND_TILT)])


def of_motion(old: Covariance, new: Covariance, dx: float, dy: float) -> Covariance:
    """Return the covariance that the motion from one pose to the next has added.

    The old uncertainty moves along: a tilt lifts the sensor by `roll * dy - pitch * dx`. Where the
    new pose is more certain than that, nothing is added.

    Args:
        old, new: covariances of both poses.
        dx, dy: motion of the sensor [m], map frame.
    """
    moved = np.array([[1.0, dy, -dx], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    scale = max(float(np.abs(old.matrix).max()), float(np.abs(new.matrix).max())) or 1.0
    added = new.matrix / scale - moved @ (old.matrix / scale) @ moved.T
    added = 0.5 * (added + added.T)
    values, vectors = np.linalg.eigh(added)
    with np.errstate(over="ignore"):
        return Covariance((vectors * np.maximum(values, 0.0)) @ vectors.T * scale)
