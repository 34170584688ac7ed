# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of elevation mapping."""

import math
from dataclasses import dataclass

from ..plugins import check

_COUNTS = ("conflict_points", "min_drift_cells")
_SHARES = ("drift_compensation_alpha", "exponential_alpha", "min_support")
_SIGNED = ("max_variance", "ignore_points_above", "ignore_points_below")


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Parameters of `ElevationMapper`.

    Attributes:
        min_variance: smallest variance of a cell [m^2].
        max_variance: largest variance [m^2], beyond which a cell becomes unknown; 0 or less is no
            limit. The default for a `ConstantModel` is 100.
        mahalanobis_distance_threshold: a point agrees with a height if they differ by at most this
            many standard deviations.
        multi_height_noise: variance that a cell gains by a scan that contradicts it [m^2].
        time_variance: variance that each cell gains per second [m^2/s].
        scanning_duration: time since the last confirmation [s] after which a cell may be cleared or
            lowered.
        conflict_points: number of points of one scan that must agree with each other to replace the
            height of a cell.
        min_support: share of the points of the densest cluster of a cell that a higher cluster
            needs to be its surface at once; with fewer points it must be seen in three scans.
        overhang_clearance: a cluster this much above another one of the same scan is an overhang
            [m]: the ground stays, and the layer `overhang` has the height of its lower side; 0
            takes the highest surface.
        max_time_jump: difference between the times of two scans [s] above which the clock of the
            map starts anew.
        enable_visibility_cleanup: True to clear cells above beams that passed through them.
        max_ray_length: length of beams [m] up to which they clear cells.
        cleanup_min_angle: smallest angle between a beam and the surface [rad]; beams that graze the
            surface clear nothing.
        enable_drift_compensation: True to move the map up or down after the scans.
        max_drift: largest offset between scan and map that is compensated [m].
        drift_compensation_alpha: share of the offset by which the map moves in an update.
        drift_compensation_variance_inlier: largest variance of cells that measure the offset [m^2].
        min_drift_cells: number of cells that must agree on the offset.
        ignore_points_above, ignore_points_below: points that are higher or lower, relative to the
            sensor, are dropped [m].
        min_range, max_range: points that are nearer or farther are dropped [m].
        horizontal_variances: True to keep the layer `horizontal_variance`, which
            `ElevationMapper.fused_map` needs.
        exponential_alpha: share of a scan in values that are fused by `exponential`.
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
        heights = self.ignore_points_below <= self.ignore_points_above
        check(
            heights, "ignore_points_below", "at most ignore_points_above", self.ignore_points_below
        )

    @property
    def largest_variance(self) -> float:
        """The limit of variances [m^2], infinite for none."""
        return self.max_variance if self.max_variance > 0 else math.inf

    @property
    def largest_share(self) -> float:
        """Largest variance [m^2] by relief or pose, which alone shall make no cell unknown."""
        return 0.25 * self.largest_variance
