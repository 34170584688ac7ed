# SPDX-License-Identifier: BSD-3-Clause
"""Pose covariances, and scan points in the map frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Positions, as_array, as_numbers
from .._arrays._pieces import PIECE
from ..errors import GeometryError, short
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..plugins import check
from ._parameters import Numbers, Parameters, SensorModel

OUTSIDE = -1
"""Cell index of points outside the map."""

LEAST_VARIANCE = 1e-12
"""Lower limit of the variance of a point [m^2], so that weights stay finite."""

_TOLERANCE = 1e-6
"""Tolerance for asymmetry and negative eigenvalues, relative to the largest matrix element."""

_HEIGHT_AND_TILT, _LEVEL = np.array([2, 3, 4]), np.array([0, 1, 5])
"""Indices of (z, roll, pitch) and of (x, y, yaw) in a pose (x, y, z, roll, pitch, yaw)."""


@dataclass(frozen=True)
class Covariance:
    """Covariance of the sensor pose, with rotations about the map axes.

    Attributes:
        matrix: (3, 3) covariance of z [m], roll and pitch [rad].
        level: (3, 3) covariance of x, y [m] and yaw [rad].
    """

    matrix: NDArray[np.float64]
    level: NDArray[np.float64]

    def of_points(self, x: Any, y: Any) -> Any:
        """Return the variance [m^2] that pose errors add to the heights of points.

        A rotation by (roll, pitch) lifts a point by `roll * y - pitch * x`, where `x` and `y` [m]
        are relative to the sensor, along the map axes.
        """
        (height, _, _), (_, roll, both), (_, _, pitch) = self.matrix.tolist()
        return height + (roll * y * y - 2.0 * both * x * y + pitch * x * x)

    def with_height(self, variance: float) -> Covariance:
        matrix = self.matrix.copy()
        matrix[0, 0] = variance
        return replace(self, matrix=matrix)

    def of_places(self, x: Any, y: Any) -> Any:
        """Return the variance [m^2] that pose errors and their correlations add to cell heights."""
        _, with_roll, with_pitch = self.matrix[0].tolist()
        return self.of_points(x, y) + 2.0 * (with_roll * y - with_pitch * x)

    def level_of_places(self, x: Any, y: Any) -> Any:
        """Return the horizontal variances [m^2] of cells due to pose errors without tilt."""
        (along_x, _, x_yaw), (_, along_y, y_yaw), (_, _, yaw) = self.level.tolist()
        return 0.5 * (along_x + along_y + yaw * (x * x + y * y)) + y_yaw * x - x_yaw * y

    def level_of_points(self, x: Any, y: Any, z: Any) -> Any:
        """Return the horizontal variances [m^2] of points due to pose errors and tilt."""
        tilt = 0.5 * float(self.matrix[1, 1] + self.matrix[2, 2])
        return self.level_of_places(x, y) + tilt * z * z


def as_covariance(values: ArrayLike | None, name: str = "pose_covariance") -> Covariance | None:
    """Convert a pose covariance (6, 6), or raise `GeometryError`; None stays None."""
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
    """Return the covariance that a motion from the pose `old` to the pose `new` adds.

    A motion by (`dx`, `dy`) [m] turns a tilt error into the height error `roll * dy - pitch * dx`,
    and a yaw error into the horizontal error `yaw * (-dy, dx)`.
    """
    tilt = np.array([[1.0, dy, -dx], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    turn = np.array([[1.0, 0.0, -dy], [0.0, 1.0, dx], [0.0, 0.0, 1.0]])
    return Covariance(_added(old.matrix, new.matrix, tilt), _added(old.level, new.level, turn))


def _added(
    old: NDArray[np.float64], new: NDArray[np.float64], moved: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return `new - moved @ old @ moved.T`, with negative eigenvalues set to 0."""
    scale = max(float(np.abs(old).max()), float(np.abs(new).max())) or 1.0
    added = new / scale - moved @ (old / scale) @ moved.T
    values, vectors = np.linalg.eigh(0.5 * (added + added.T))
    with np.errstate(over="ignore"):
        result: NDArray[np.float64] = (vectors * np.maximum(values, 0.0)) @ vectors.T * scale
    return result


@dataclass(frozen=True)
class Scan:
    """Points of a scan that are within all limits.

    Attributes:
        sensor: (3,) position of the sensor [m], map frame.
        points: (3, n) x, y, z [m], map frame.
        variances: (n,) variances of z from the sensor noise alone [m^2].
        cells: (n,) column-major cell index of each point in map order, or OUTSIDE.
        places: (n,) indices of the points in the cloud.
        horizontal: (n,) horizontal variances, averaged over x and y [m^2]; empty if not requested.
        dropped: number of dropped points for each reason.
        noise: pose covariance, shared by all points; None means an exact pose.
    """

    sensor: Positions
    points: NDArray[np.float64]
    variances: Numbers
    cells: Integers
    places: Integers
    horizontal: Numbers
    dropped: dict[str, int]
    noise: Covariance | None

    def lowered(self, offset: float) -> Scan:
        down = np.array([0.0, 0.0, offset])
        return replace(self, sensor=self.sensor - down, points=self.points - down[:, None])

    def variances_by_pose(self, x: Numbers, y: Numbers) -> Numbers:
        """Return the height variances [m^2] due to pose errors at `x`, `y` (k,) [m], map frame."""
        if self.noise is None:
            return np.zeros(len(x))
        with np.errstate(over="ignore", invalid="ignore"):
            found: Numbers = self.noise.of_points(x - self.sensor[0], y - self.sensor[1])
        return found


def rotated(points: NDArray[Any], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotate points (n, 3 or more), and return x, y, z (3, n)."""
    # The rounding of a matrix product would depend on the index of a point.
    x, y, z = (points[:, axis].astype(np.float64) for axis in range(3))
    turned = np.empty((3, len(points)))
    with np.errstate(over="ignore", invalid="ignore"):
        for row, out in zip(rotation.tolist(), turned, strict=True):
            np.multiply(x, row[0], out=out)
            out += y * row[1]
            out += z * row[2]
    return turned


def distances_of(points: NDArray[np.float64]) -> Numbers:
    """Return the distances (n,) of points (3, n) from the origin [m]."""
    with np.errstate(over="ignore", invalid="ignore"):
        distances: Numbers = np.sqrt(
            points[0] * points[0] + points[1] * points[1] + points[2] * points[2]
        )
    return distances


def in_map_order(grid_map: GridMap, position: ArrayLike | None) -> GridMap:
    """Return a copy of a map in map order, moved to `position` unless it is None."""
    result = grid_map.copy()
    if position is not None:
        result.move(position)
    result.convert_to_default_start_index()
    return result


def as_columns(values: Mapping[str, ArrayLike] | None, count: int) -> dict[str, NDArray[Any]]:
    """Validate point values, and return them as arrays (count,) by layer name."""
    columns = {}
    check(isinstance(values, Mapping | None), "values", "a mapping from names", values)
    for name, given in (values or {}).items():
        column = as_numbers(given, f"values {name!r}")
        if column.shape != (count,):
            raise GeometryError(f"values {name!r}: expected shape ({count},), got {column.shape}")
        columns[name] = column
    return columns


def located(
    cloud: NDArray[Any],
    transform: NDArray[np.float64],
    noise: Covariance | None,
    sensor: SensorModel,
    geometry: GridGeometry,
    given: Parameters,
) -> Scan:
    """Return the finite points of a cloud (N, 3 or more) [m] that are within all limits."""
    count, kept, dropped = len(cloud), 0, dict[str, int]()
    points, variances = np.empty((3, count)), np.empty(count)
    cells, places = np.empty((2, count), np.int64)
    for begin in range(0, count, PIECE):
        part = slice(begin, begin + PIECE)
        found = _located_part(cloud[part], transform, sensor, geometry, given, dropped)
        here = slice(kept, kept + len(found[0]))
        places[here], points[:, here], variances[here], cells[here] = found
        places[here] += begin
        kept = here.stop
    places = places[:kept]
    return Scan(
        transform[:3, 3],
        points[:, :kept],
        variances[:kept],
        cells[:kept],
        places,
        _horizontal(cloud[places], transform, noise, sensor)
        if given.horizontal_variances
        else np.empty(0),
        dropped,
        noise,
    )


def _horizontal(
    cloud: NDArray[Any],
    transform: NDArray[np.float64],
    covariance: Covariance | None,
    sensor: SensorModel,
) -> Numbers:
    """Return the horizontal variance (n,) of each point, averaged over x and y [m^2]."""
    own = np.ascontiguousarray(cloud[:, :3].T, dtype=np.float64)
    distances = distances_of(own)
    along = [sensor.vertical_variances(own, distances, axis) for axis in transform[:2, :3]]
    variances: Numbers = 0.5 * (along[0] + along[1])
    if covariance is not None:
        variances = variances + covariance.level_of_points(*rotated(cloud, transform[:3, :3]))
    return variances


def _located_part(
    cloud: NDArray[Any],
    transform: NDArray[np.float64],
    sensor: SensorModel,
    geometry: GridGeometry,
    given: Parameters,
    dropped: dict[str, int],
) -> tuple[Integers, NDArray[np.float64], Numbers, Integers]:
    """Return the indices, positions (3, n), variances and cells of the kept points."""
    turned = rotated(cloud, transform[:3, :3])
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        distances = distances_of(turned)
        own = np.ascontiguousarray(cloud[:, :3].T, dtype=np.float64)
        points = turned + transform[:3, 3:4]
        variances = np.maximum(
            sensor.vertical_variances(own, distances, transform[2, :3]), LEAST_VARIANCE
        )
        fits = {
            "not finite, or at the origin of the sensor": (distances > 0.0)
            & np.isfinite(distances + points[2]),
            "nearer than min_range": distances >= given.min_range,
            "farther than max_range": distances <= given.max_range,
            "below ignore_points_below": turned[2] >= given.ignore_points_below,
            "above ignore_points_above": turned[2] <= given.ignore_points_above,
            "not measured by the sensor": np.isfinite(variances),
        }
    counts = np.ones(len(cloud), np.bool_)
    for reason, is_fit in fits.items():
        dropped[reason] = dropped.get(reason, 0) + int((counts & ~is_fit).sum())
        counts &= is_fit
    places = np.flatnonzero(counts)
    if len(places) < len(cloud):
        points, variances = points.take(places, axis=1), variances[places]
    (rows, columns), inside = geometry.cells_at(points[:2].T)
    cells = rows + geometry.size[0] * columns
    cells[~inside] = OUTSIDE
    return places, points, variances, cells
