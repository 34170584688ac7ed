# SPDX-License-Identifier: BSD-3-Clause
"""Points of scans: from the frame of the sensor to cells, with poses and limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Positions, as_numbers
from .._arrays._pieces import PIECE, slices
from ..conversions._point_layers import as_points as as_points, flat_cells
from ..errors import GeometryError
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..map._transform import as_rigid as as_rigid
from ..plugins import check
from ._motion import Covariance
from ._parameters import Parameters
from ._sensors import Numbers, SensorModel

OUTSIDE = -1
"""In place of the cell of a point beside the map."""

LEAST_VARIANCE = 1e-12
"""Variance [m^2] of points that claim a smaller one, so that weights stay finite."""


@dataclass(frozen=True)
class Scan:
    """Points of a scan within all limits.

    Attributes:
        sensor: (3,) position of the sensor [m], map frame.
        points: (3, n) x, y, z [m], map frame.
        variances: (n,) variances of z from the sensor alone [m^2].
        cells: (n,) number of the cell of each point, column after column in map order, or
            `OUTSIDE`.
        places: (n,) places of the points in the cloud.
        horizontal: (n,) variances along x and y [m^2]; (0,) if they are not wanted.
        dropped: number of dropped points by reason.
        noise: covariance of the pose, which all points share; None means an exact pose.
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
        """Return the scan, lower by an offset [m]."""
        down = np.array([0.0, 0.0, offset])
        return replace(self, sensor=self.sensor - down, points=self.points - down[:, None])

    def variances_by_pose(self, x: Numbers, y: Numbers) -> Numbers:
        """Return the variances of z (k,) at places in the map frame, due to the pose [m^2]."""
        if self.noise is None:
            return np.zeros(len(x))
        with np.errstate(over="ignore", invalid="ignore"):
            found: Numbers = self.noise.of_points(x - self.sensor[0], y - self.sensor[1])
        return found


def rotated(points: NDArray[Any], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (n, 3) or wider, rotated by (3, 3), as x, y, z (3, n).

    Unlike in a product of matrices, rounding does not depend on the place of a point in the array.
    """
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
    """Return a copy of a map, moved by whole cells and stored from start index (0, 0)."""
    result = grid_map.copy()
    if position is not None:
        result.move(position)
    result.convert_to_default_start_index()
    return result


def as_columns(values: Mapping[str, ArrayLike] | None, count: int) -> dict[str, NDArray[Any]]:
    """Return values of points (count,) by name."""
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
    """Return the points that are finite and within all limits, with their variances and cells.

    Args:
        cloud: (N, 3) or wider, sensor frame [m].
        transform: (4, 4) from the sensor to the map frame.
        noise: covariance of the pose, which all points share; None means an exact pose.
        sensor: model of the noise.
        geometry: geometry of the map.
        given: parameters.
    """
    count, kept, dropped = len(cloud), 0, dict[str, int]()
    points, variances = np.empty((3, count)), np.empty(count)
    cells, places = np.empty((2, count), np.int64)
    for part in slices(count, PIECE):
        found = _located_part(cloud[part], transform, sensor, geometry, given, dropped)
        here = slice(kept, kept + len(found[0]))
        places[here], points[:, here], variances[here], cells[here] = found
        places[here] += part.start
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
    """Return the mean (n,) of the variances of points along x and along y [m^2]."""
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
    """Return places, positions (3, n), variances and cells of the points that count."""
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
    cells, inside = flat_cells(points[:2].T, geometry)
    cells[~inside] = OUTSIDE
    return places, points, variances, cells
