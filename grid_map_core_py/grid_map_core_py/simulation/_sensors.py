# SPDX-License-Identifier: BSD-3-Clause
"""Range sensors: beam directions and simulated scans."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Positions, as_array
from ..elevation import SensorModel
from ..errors import GeometryError
from ..map import GridMap
from ..plugins import check
from ._rays import cast_rays


@dataclass(frozen=True, kw_only=True)
class SpinningLidar:
    """Beam directions of a lidar that spins around its z axis; x is forward.

    Attributes:
        rings: number of rings, at equally spaced elevation angles.
        lowest, highest: elevation angles of the outermost rings [rad].
        azimuths: number of beams per ring and revolution.
    """

    rings: int = 16
    lowest: float = math.radians(-15.0)
    highest: float = math.radians(15.0)
    azimuths: int = 1800

    def __post_init__(self) -> None:
        check(self.rings >= 1, "rings", "at least 1", self.rings)
        check(self.azimuths >= 1, "azimuths", "at least 1", self.azimuths)

    @property
    def directions(self) -> Positions:
        """(rings * azimuths, 3) unit vectors, sensor frame, ring by ring from the lowest.

        Each ring starts in the direction of x and turns towards y.
        """
        elevations = np.linspace(self.lowest, self.highest, self.rings)
        azimuths = np.linspace(0.0, 2.0 * np.pi, self.azimuths, endpoint=False)
        elevation, azimuth = np.meshgrid(elevations, azimuths, indexing="ij")
        level = np.cos(elevation)
        axes = level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)
        return np.stack(axes, axis=-1).reshape(-1, 3)


@dataclass(frozen=True, kw_only=True)
class DepthCamera:
    """Beam directions of a pinhole depth camera; z is forward, x right and y down.

    Attributes:
        width, height: number of pixels.
        angle: horizontal field of view between the outer borders of the image [rad].
    """

    width: int = 106
    height: int = 60
    angle: float = math.radians(87.0)

    def __post_init__(self) -> None:
        for name, count in (("width", self.width), ("height", self.height)):
            check(count >= 1, name, "at least 1", count)
        check(0.0 < self.angle < math.pi, "angle", "more than 0 and less than pi", self.angle)

    @property
    def focal_length(self) -> float:
        """Focal length [pixels]; the principal point is the center of the image."""
        return 0.5 * self.width / math.tan(0.5 * self.angle)

    @property
    def directions(self) -> Positions:
        """(height * width, 3) vectors with z = 1, row by row from the top, left to right."""
        x = (np.arange(self.width) - 0.5 * (self.width - 1)) / self.focal_length
        y = (np.arange(self.height) - 0.5 * (self.height - 1)) / self.focal_length
        down, right = np.meshgrid(y, x, indexing="ij")
        return np.stack((right, down, np.ones_like(right)), axis=-1).reshape(-1, 3)


def scan(
    grid_map: GridMap,
    directions: ArrayLike,
    transform: ArrayLike,
    *,
    sensor: SensorModel | None = None,
    random: np.random.Generator | None = None,
    layer: str = "elevation",
    max_range: float = np.inf,
) -> Positions:
    """Simulate a scan of a terrain with a sensor that does not move during the scan.

    Args:
        grid_map: the terrain; `cast_rays` defines the surface.
        directions: (N, 3) beam directions, sensor frame, such as `SpinningLidar().directions`.
        transform: (4, 4) homogeneous transform from the sensor frame to the map frame.
        sensor: noise model; None for no noise. The noise is Gaussian, with the covariance that the
            model predicts at the true point. Points that the sensor cannot measure become NaN.
        random: random generator for the noise; None creates a new generator for each call.
        layer: name of the height layer [m].
        max_range: range beyond which beams do not return [m].

    Returns:
        (N, 3) points [m], sensor frame, in the order of the beams. NaN for beams that do not
        return.

    Raises:
        GeometryError: an array has the wrong shape, or `max_range` is not a number above 0.
        LayerNotFoundError: the map has no such layer.
    """
    pose = as_array(transform, np.float64, "transform")
    if pose.shape != (4, 4):
        raise GeometryError(f"transform: expected the shape (4, 4), got {pose.shape}")
    along = as_array(directions, np.float64, "directions")
    rotation, origin = pose[:3, :3], pose[:3, 3]
    ranges = cast_rays(grid_map, origin, along @ rotation.T, layer=layer, max_range=max_range)
    points: Positions = along * (ranges / np.linalg.norm(along, axis=1))[:, None]
    if sensor is not None:
        returned = np.flatnonzero(np.isfinite(ranges))
        random = np.random.default_rng() if random is None else random
        points[returned] += _noise(_covariances(sensor, points[returned]), random)
    return points


def _covariances(sensor: SensorModel, points: Positions) -> NDArray[np.float64]:
    """Return the covariances (N, 3, 3) of points [m^2]; NaN for points that cannot be measured."""
    coordinates = np.ascontiguousarray(points.T)
    distances = np.linalg.norm(points, axis=1)
    # The variance of covariance S along a unit vector is `axis @ S @ axis`.
    axes, found = np.eye(3), np.empty((len(points), 3, 3))
    for i in range(3):
        found[:, i, i] = sensor.vertical_variances(coordinates, distances, axes[i])
    for i, j in ((0, 1), (0, 2), (1, 2)):
        between = (axes[i] + axes[j]) / math.sqrt(2.0)
        variances = sensor.vertical_variances(coordinates, distances, between)
        found[:, i, j] = found[:, j, i] = variances - 0.5 * (found[:, i, i] + found[:, j, j])
    return found


def _noise(covariances: NDArray[np.float64], random: np.random.Generator) -> Positions:
    """Draw one normally distributed vector per covariance, (N, 3)."""
    # Covariances may be singular. If a covariance is not finite, the vector is NaN.
    measured = np.isfinite(covariances.sum(axis=(1, 2)))
    variances, axes = np.linalg.eigh(np.where(measured[:, None, None], covariances, 0.0))
    normal = random.standard_normal(variances.shape) * np.sqrt(np.maximum(variances, 0.0))
    noise: Positions = np.einsum("nij,nj->ni", axes, normal)
    noise[~measured] = np.nan
    return noise
