# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of elevation mapping, and sensor models that predict the variances of points.

A model returns the variance `axis @ S @ axis` along a unit vector `axis` (3,), where S (3, 3) is
the covariance of a point in the sensor frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from .._parameters import cast, check

_COUNTS = ("conflict_points", "min_drift_cells")
_SHARES = ("drift_compensation_alpha", "exponential_alpha", "min_support")
_SIGNED = ("max_variance", "ignore_points_above", "ignore_points_below")


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Parameters of `ElevationMapper`.

    Attributes:
        min_variance: smallest variance of a cell [m^2].
        max_variance: variance [m^2] above which a cell becomes unknown; 0 or less means no limit.
            The default for a `ConstantModel` is 100.
        mahalanobis_distance_threshold: largest difference between a point and the cell height
            that counts as agreement [standard deviations].
        multi_height_noise: variance added to a cell whose height a scan contradicts [m^2].
        time_variance: growth rate of the variance of every cell [m^2/s].
        scanning_duration: time without confirmation after which a cell may be cleared or lowered
            [s].
        conflict_points: number of points in one scan that must agree to replace a height.
        min_support: smallest number of points in a surface cluster, relative to the largest cluster
            in the cell. A smaller cluster becomes the surface only after three scans.
        overhang_clearance: vertical gap [m] above which a cluster counts as an overhang. The cell
            then keeps the ground height, and the layer `overhang` holds the underside. With 0, the
            cell gets the highest surface.
        max_time_jump: time difference between two scans above which the map clock restarts [s].
        enable_visibility_cleanup: clear cells that beams have passed through.
        max_ray_length: distance from the sensor up to which beams clear cells [m].
        cleanup_min_angle: smallest angle between a surface and the beams that clear it [rad].
        enable_drift_compensation: shift the map vertically to match the scans.
        max_drift: largest offset between scan and map that is compensated [m].
        drift_compensation_alpha: share of the offset that each scan corrects, 0 to 1.
        drift_compensation_variance_inlier: largest variance of cells that determine the offset
            [m^2].
        min_drift_cells: number of cells that must agree on the offset.
        ignore_points_above: height relative to the sensor above which points are ignored [m].
        ignore_points_below: height relative to the sensor below which points are ignored [m].
        min_range: distance from the sensor below which points are ignored [m].
        max_range: distance from the sensor above which points are ignored [m].
        horizontal_variances: add the layer `horizontal_variance`, which `ElevationMapper.fused_map`
            needs.
        exponential_alpha: weight of the last scan in `exponential` fusion, 0 to 1.
    """

    min_variance: float = 9e-6
    max_variance: float = 0.01
    mahalanobis_distance_threshold: float = 2.5
    multi_height_noise: float = 9e-7
    time_variance: float = 0.0
    scanning_duration: float = 1.0
    conflict_points: int = 2
    min_support: float = 0.2
    overhang_clearance: float = 0.0
    max_time_jump: float = 10.0
    enable_visibility_cleanup: bool = True
    max_ray_length: float = 10.0
    cleanup_min_angle: float = 0.1
    enable_drift_compensation: bool = False
    max_drift: float = 0.1
    drift_compensation_alpha: float = 0.1
    drift_compensation_variance_inlier: float = 0.0025
    min_drift_cells: int = 100
    ignore_points_above: float = math.inf
    ignore_points_below: float = -math.inf
    min_range: float = 0.0
    max_range: float = math.inf
    horizontal_variances: bool = False
    exponential_alpha: float = 0.7

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            check(not math.isnan(value), name, "a number", value)
            if name in _COUNTS:
                check(value >= 1, name, "at least 1", value)
            elif name not in _SIGNED:
                check(value >= 0, name, "no negative number", value)
            if name in _SHARES:
                check(value <= 1, name, "at most 1", value)
        for name in ("min_variance", "mahalanobis_distance_threshold", "max_time_jump"):
            check(getattr(self, name) > 0, name, "more than 0", getattr(self, name))
        check(self.min_variance < math.inf, "min_variance", "a finite number", self.min_variance)
        is_open = self.max_variance <= 0 or self.max_variance >= self.min_variance
        check(is_open, "max_variance", "at least min_variance, or 0", self.max_variance)
        ranges = self.min_range <= self.max_range
        check(ranges, "min_range", "at most max_range", self.min_range)
        lowest, highest = self.ignore_points_below, self.ignore_points_above
        check(lowest <= highest, "ignore_points_below", "at most ignore_points_above", lowest)

    @property
    def largest_variance(self) -> float:
        """Variance [m^2] above which cells become unknown; infinite if there is no limit."""
        return self.max_variance if self.max_variance > 0 else math.inf

    @property
    def largest_share(self) -> float:
        """Largest variance [m^2] that terrain relief or pose errors may add to a cell."""
        return 0.25 * self.largest_variance


# Sensor models

Numbers = NDArray[np.float64]
"""(n,) one number per point."""


class SensorModel(Protocol):
    """Interface for range sensor noise models; implement it for custom sensors."""

    def vertical_variances(self, points: Numbers, distances: Numbers, axis: Numbers) -> Numbers:
        """Return the variances (n,) of points along an axis, usually the vertical [m^2].

        Args:
            points: (3, n) x, y, z [m], sensor frame.
            distances: (n,) distances from the sensor [m], more than 0.
            axis: (3,) unit vector, sensor frame: the vertical axis of the map, or its x or y axis
                for horizontal variances.

        Returns:
            Variances [m^2]; NaN for points that the sensor cannot measure, which are then dropped.
        """


class _Model:
    """Base class of sensor models that validates their attributes."""

    max_variance: ClassVar[float] = 0.01
    """Default of `Parameters.max_variance` for this sensor [m^2]."""

    _signed: tuple[str, ...] = ()
    _positive: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for field in fields(self):  # type: ignore[arg-type]
            name, value = field.name, getattr(self, field.name)
            value = cast(name, value, float)
            object.__setattr__(self, name, value)
            check(np.isfinite(value), name, "a finite number", value)
            check(value >= 0 or name in self._signed, name, "no negative number", value)
            check(value > 0 or name not in self._positive, name, "a positive number", value)


@dataclass(frozen=True, kw_only=True)
class LaserModel(_Model):
    """Lidar with noise along and across each beam.

    The noise across a beam grows with the distance. Each point defines the direction of its beam,
    so the model also fits spinning lidars.

    Attributes:
        min_radius: standard deviation along the beam [m].
        beam_constant: standard deviation across the beam at distance 0 [m].
        beam_angle: increase of the standard deviation across the beam per meter of distance [rad].
    """

    min_radius: float = 0.018
    beam_constant: float = 0.0015
    beam_angle: float = 0.0006

    def vertical_variances(self, points: Any, distances: Any, axis: Any) -> Any:
        # In a matrix product, rounding would depend on the index of a point in the array.
        x, y, z = map(float, axis)
        slope = (points[0] * x + points[1] * y + points[2] * z) / distances
        slope *= slope
        across = self.beam_constant + self.beam_angle * distances
        across *= across
        return across * np.maximum(1.0 - slope, 0.0) + self.min_radius**2 * slope


class _Camera(_Model):
    """Base class of cameras with noise along and across the optical axis (z, sensor frame)."""

    def vertical_variances(self, points: Any, distances: Any, axis: Any) -> Any:
        del distances
        depth = points[2]
        share = min(float(axis[2]) ** 2, 1.0)
        along, lateral = self._deviations(depth)
        variances = along * along * share + lateral * lateral * (1.0 - share)
        return np.where(self._is_measured(depth), variances, np.nan)

    def _deviations(self, depth: Any) -> tuple[Any, Any]:
        """Return the standard deviations [m] along and across the optical axis."""
        raise NotImplementedError

    def _is_measured(self, depth: Any) -> Any:
        return depth > 0.0


@dataclass(frozen=True, kw_only=True)
class StructuredLightModel(_Camera):
    """Depth camera with structured light.

    The depth z is the coordinate along the optical axis, which is the z axis of the sensor frame.
    The formula for its standard deviation is from Nguyen, Izadi and Lovell, "Modeling Kinect Sensor
    Noise for Improved 3D Reconstruction and Tracking", 2012.

    Attributes:
        cutoff_min_depth: depth below which points are dropped [m].
        cutoff_max_depth: depth above which points are dropped [m].
        normal_factor_a: `a` in the standard deviation of the depth z, `a + b (z - c)^2 + d z^e`
            [m].
        normal_factor_b: `b` in the formula of `normal_factor_a`.
        normal_factor_c: `c` in the formula of `normal_factor_a`.
        normal_factor_d: `d` in the formula of `normal_factor_a`.
        normal_factor_e: `e` in the formula of `normal_factor_a`.
        lateral_factor: standard deviation of points perpendicular to the optical axis [m], per
            meter of depth.
    """

    cutoff_min_depth: float = 0.2
    cutoff_max_depth: float = 3.25
    normal_factor_a: float = 0.000611
    normal_factor_b: float = 0.003587
    normal_factor_c: float = 0.3515
    normal_factor_d: float = 0.0
    normal_factor_e: float = 1.0
    lateral_factor: float = 0.01576

    _signed = tuple(f"normal_factor_{letter}" for letter in "abcde")

    def __post_init__(self) -> None:
        super().__post_init__()
        limits = self.cutoff_min_depth, self.cutoff_max_depth
        check(limits[0] <= limits[1], "cutoff_min_depth", "at most cutoff_max_depth", limits[0])

    def _deviations(self, depth: Any) -> tuple[Any, Any]:
        offset = depth - self.normal_factor_c
        along = self.normal_factor_a + self.normal_factor_b * offset * offset
        if self.normal_factor_d:
            along = along + self.normal_factor_d * np.maximum(depth, 0.0) ** self.normal_factor_e
        return along, self.lateral_factor * depth

    def _is_measured(self, depth: Any) -> Any:
        return (depth >= self.cutoff_min_depth) & (depth <= self.cutoff_max_depth)


@dataclass(frozen=True, kw_only=True)
class StereoModel(_Camera):
    """Stereo camera.

    The depth z is the coordinate along the optical axis, which is the z axis of the sensor frame.
    Its standard deviation is `z^2 / (focal_length * baseline) * disparity_std` [m]. Points with a
    depth of 0 or less are dropped.

    Attributes:
        focal_length: focal length [pixels].
        baseline: distance between the cameras [m].
        disparity_std: standard deviation of disparities [pixels].
        lateral_factor: standard deviation of points perpendicular to the optical axis [m], per
            meter of depth.
    """

    focal_length: float = 640.0
    baseline: float = 0.05
    disparity_std: float = 0.1
    lateral_factor: float = 0.001376

    _positive = ("focal_length", "baseline")

    def _deviations(self, depth: Any) -> tuple[Any, Any]:
        per_pixel = self.disparity_std / (self.focal_length * self.baseline)
        return depth * depth * per_pixel, self.lateral_factor * depth


@dataclass(frozen=True, kw_only=True)
class PerfectModel(_Model):
    """Sensor without noise, for simulations."""

    def vertical_variances(self, points: Any, distances: Any, axis: Any) -> Any:
        del points, axis
        return np.zeros_like(distances)


@dataclass(frozen=True, kw_only=True)
class ConstantModel(_Model):
    """Sensor whose variance in each direction is proportional to the squared distance.

    Attributes:
        sensor_noise_factor: variance at a distance of 1 m [m^2].
    """

    max_variance = 100.0  # as in elevation_mapping_cupy

    sensor_noise_factor: float = 0.05

    def vertical_variances(self, points: Any, distances: Any, axis: Any) -> Any:
        del points, axis
        return self.sensor_noise_factor * (distances * distances)
