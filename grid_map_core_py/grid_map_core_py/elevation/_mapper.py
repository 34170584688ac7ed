# SPDX-License-Identifier: BSD-3-Clause
"""Defines `ElevationMapper`; sibling modules implement the stages of an update."""

from __future__ import annotations

import math
import operator
import time
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import as_points, as_rigid
from .._parameters import build, check
from ..errors import GridMapError, LayerNotFoundError, short
from ..limits import check_cells
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from . import _horizontal as horizontal
from ._clusters import clusters_of, deal, grow_clusters, sorted_by_cell
from ._fusion import Fusion, Outcome, drift
from ._parameters import LaserModel, Parameters, SensorModel
from ._points import (
    OUTSIDE,
    Covariance,
    Scan,
    as_columns,
    as_covariance,
    in_map_order,
    located,
    of_motion,
)
from ._state import (
    BOUNDS,
    HIDDEN,
    HORIZONTAL,
    OVERHANG,
    OWN,
    State,
    at_centers,
    flat,
    is_value_name,
    shaped,
)
from ._values import Chosen, ValueFusion
from ._visibility import cleared_cells, cover, entry_heights, trace

LATE = 10**9
"""If timestamps are too early for longer than this time [ns], the map clock restarts."""


@dataclass(frozen=True)
class UpdateReport:
    """Summary of one update.

    Attributes:
        points_used: number of points that contributed to the height of a cell.
        points_dropped: number of points that were ignored.
        points_gated: number of points on the map that disagree with the height of their cell.
        reasons: number of dropped points for each reason.
        conflicts: number of cells whose previous height the scan contradicts or replaces.
        cells_cleared: number of cells that the visibility cleanup cleared.
        drift: vertical offset of the scan from the map [m]. It is 0 if drift compensation is
            disabled, or if too few cells agree on an offset.
        milliseconds: duration of each stage of the update [ms]: `points`, `clusters`, `drift`,
            `fusion`, `visibility`, `values`, `layers`.
    """

    points_used: int
    points_dropped: int
    points_gated: int
    reasons: Mapping[str, int]
    conflicts: int
    cells_cleared: int
    drift: float
    milliseconds: Mapping[str, float]


class ElevationMapper:
    """Elevation map around a moving robot, built from range sensor scans.

    The map has the following layers, in which NaN means unknown:

    - `elevation`: height [m].
    - `variance`: variance of the height [m^2].
    - `time`: time at which a scan last confirmed the height [s since the first scan].
    - `upper_bound`, `lower_bound`: 99 % confidence bounds of the height [m].
    - one layer for each additional point value.

    Args:
        geometry: size, resolution and initial position of the map.
        frame_id: frame of the map.
        sensor: noise model of the sensor. `update` can use another model for one scan.
        value_fusions: fusion method of each point value. A key is the name of a point value, or a
            regular expression that matches the name. The methods are `average`, `latest`,
            `exponential`, `max`, `color` and `class_bayesian`. The default is `color` for `rgb`,
            `rgba` and `color`, and `average` for all others.
        parameters: elevation mapping parameters, such as `min_variance`. The property `parameters`
            lists all.

    Raises:
        ConfigError: a parameter is unknown or invalid.
        LimitError: the map would have too many cells.

    Example:
        >>> import numpy as np
        >>> from grid_map_core_py import GridGeometry
        >>> mapper = ElevationMapper(GridGeometry((4.0, 4.0), 0.1))
        >>> pose = np.eye(4)
        >>> pose[2, 3] = 1.0  # the sensor is 1 m above the origin of the map
        >>> report = mapper.update([[0.52, 0.03, -0.8]], pose, timestamp=0)
        >>> report.points_used
        1
        >>> index = mapper.grid_map.get_index((0.52, 0.03))
        >>> round(float(mapper.grid_map["elevation"][index]), 3)
        0.2
    """

    def __init__(
        self,
        geometry: GridGeometry,
        frame_id: str = "odom",
        *,
        sensor: SensorModel | None = None,
        value_fusions: Mapping[str, str] | None = None,
        **parameters: Any,
    ) -> None:
        if not isinstance(geometry, GridGeometry):
            raise GridMapError(f"geometry: expected a GridGeometry, got {short(geometry)}")
        self._sensor = _as_sensor(sensor or LaserModel())
        limit = getattr(self._sensor, "max_variance", Parameters.max_variance)
        self._parameters = build(Parameters, {"max_variance": limit} | parameters)
        self._values = ValueFusion(value_fusions or {}, self._parameters.exponential_alpha)
        check_cells("geometry", geometry.size, len(OWN))
        own = (*OWN, HORIZONTAL) if self._parameters.horizontal_variances else OWN
        self._map = GridMap.from_geometry(
            geometry, own, basic_layers=["elevation"], frame_id=frame_id
        )
        self._hidden = GridMap.from_geometry(geometry, HIDDEN)
        self._pose: tuple[Covariance, NDArray[np.float64]] | None = None
        self._noise = math.inf
        self._start: int | None = None
        self._last = 0
        self._late: int | None = None
        # Compile the loops now, so that the first scan is not delayed.
        for loop in (deal, grow_clusters, cover, trace):
            loop.compiled()

    @property
    def grid_map(self) -> GridMap:
        """The current map. Each update creates a new map; earlier maps stay unchanged."""
        return self._map

    @property
    def parameters(self) -> Parameters:
        """The current parameters."""
        return self._parameters

    def update(
        self,
        points: ArrayLike,
        transform: ArrayLike,
        *,
        timestamp: int,
        pose_covariance: ArrayLike | None = None,
        values: Mapping[str, ArrayLike] | None = None,
        position: ArrayLike | None = None,
        sensor: SensorModel | None = None,
        limits: Parameters | None = None,
    ) -> UpdateReport:
        """Fuse the points of a scan into the map.

        If an error occurs, the map stays unchanged. The order of the points has no effect.

        The map clock, which the layer `time` refers to, starts with the first scan. It restarts at
        `timestamp` in two cases, with a `RuntimeWarning`:

        - `timestamp` differs from the previous timestamp by more than `max_time_jump`.
        - Scans arrive with earlier timestamps for more than a second.

        After a restart, all known cells count as just confirmed. A timestamp of 0 that is more than
        `max_time_jump` too early does not restart the clock. Instead, all points of the scan are
        dropped, and a `RuntimeWarning` is issued.

        Args:
            points: (N, 3 or more) x, y, z [m], sensor frame. Points that are not finite or lie at
                the origin are dropped.
            transform: (4, 4) transform from the sensor to the map frame.
            timestamp: time of the scan [ns]. If it is earlier than the previous timestamp, the
                previous timestamp is used.
            pose_covariance: (6, 6) covariance of the sensor pose: x, y, z [m], roll, pitch, yaw
                [rad]; rotations are about the map axes. None means an exact pose.
            values: additional point values (N,) by layer name.
            position: (2,) new center of the map [m], set before fusing; None does not move the map.
            sensor: noise model; None uses the model passed to the constructor.
            limits: parameters that contain the range and height limits of this scan, such as
                `dataclasses.replace(mapper.parameters, max_range=5.0)`; None uses `parameters`.

        Raises:
            GridMapError: an argument is invalid; the message names the argument.
            LimitError: the value layers would be too large.
        """
        clock = _Stages()
        with clock.stage("points"):
            cloud = as_points(points)
            matrix = as_rigid(transform)
            covariance = as_covariance(pose_covariance)
            try:
                stamp = operator.index(timestamp)
            except TypeError:
                found = short(timestamp)
                text = f"timestamp: expected an integer of nanoseconds, got {found}"
                raise GridMapError(text) from None
            model = self._sensor if sensor is None else _as_sensor(sensor)
            columns = as_columns(values, len(cloud))
            for name in columns:
                if not is_value_name(name):
                    raise GridMapError(f"values: expected a different layer name, got {name!r}")
            if new := [name for name in columns if name not in self._map]:
                check_cells("values", self._map.size, len(self._map) + 2 * len(new))
            last = stamp if self._start is None else self._last
            jump = 1e-9 * (stamp - last)
            if stamp == 0 and -jump > self._parameters.max_time_jump:
                text = f"timestamp: expected the time of the scan, got 0 after {last} ns"
                warnings.warn(f"{text}; its points are dropped", RuntimeWarning, stacklevel=2)
                reasons = {"timestamp 0": len(cloud)}
                return UpdateReport(0, len(cloud), 0, reasons, 0, 0, 0.0, clock.milliseconds)
            moved = in_map_order(self._map.without_layers(BOUNDS), position)
            hidden = in_map_order(self._hidden, moved.position)
            height, noise = self._noise, covariance
            if covariance is not None:
                # Odometry drift does not count as noise, because drift compensation shifts the map.
                height = min(height, float(covariance.matrix[0, 0]))
                noise = covariance.with_height(min(height, self._parameters.largest_share))
            limits = limits or self._parameters
            scan = located(cloud, matrix, noise, model, moved.geometry, limits)
        state = State.of(moved, hidden)
        if covariance is not None and self._pose is not None:
            _add_motion(state, *self._pose, covariance, matrix, moved.geometry)
        start, stamp = self._advance(state, stamp, last, jump)
        report = self._fuse(scan, columns, state, moved.geometry, 1e-9 * (stamp - start), clock)
        with clock.stage("layers"):
            done = moved.with_layers(shaped(state.layers(self._parameters), moved.size))
            done.timestamp = stamp
            hidden = hidden.with_layers(shaped(state.hidden(), hidden.size))
        self._map, self._hidden = done, hidden
        self._pose = None if covariance is None else (covariance, matrix)
        self._start, self._last = start, stamp
        self._noise = height
        return report

    def configure(self, **parameters: Any) -> None:
        """Change parameters, except `horizontal_variances`. An error leaves all unchanged."""
        new = build(Parameters, {**vars(self._parameters), **parameters})
        has_layer = self._parameters.horizontal_variances
        kept = new.horizontal_variances == has_layer
        check(kept, "horizontal_variances", f"{has_layer}, as at the start", not has_layer)
        self._parameters = new
        if not new.overhang_clearance and OVERHANG in self._map:
            self._map = self._map.without_layers([OVERHANG])
        self._values.alpha = self._parameters.exponential_alpha

    def move(self, position: ArrayLike) -> None:
        """Move the map by whole cells to a new center (2,) [m]. Cells that leave the map are lost.

        Raises:
            GeometryError: the position is not finite, or is 2^52 or more cells away.
        """
        self._map = in_map_order(self._map, position)
        self._hidden = in_map_order(self._hidden, position)

    def clear(self) -> None:
        """Set all cells to unknown; the clock is not reset."""
        self._map = self._map.copy()
        self._map.clear_all()
        self._hidden = GridMap.from_geometry(self._map.geometry, HIDDEN)
        self._noise = math.inf

    def masked_replace(self, grid_map: GridMap, mask_layer: str = "mask") -> None:
        """Replace the cells of this map with the cells of another map where the maps overlap.

        In each layer that both maps have, a cell gets the value of the cell in the other map that
        contains its center. NaN values are copied too. Variances that are unknown or below
        `min_variance` become `min_variance`. The bounds and the layer `time` are not copied. The
        bounds are recomputed, and replaced heights count as confirmed by the last scan.

        Args:
            grid_map: the other map, in the same frame.
            mask_layer: layer of the other map; cells where this layer is NaN stay unchanged. If the
                layer does not exist, all overlapping cells are replaced.

        Raises:
            GridMapError: `grid_map` is not a map, or has another frame.
            LayerNotFoundError: the maps have no layer in common.
        """
        if not isinstance(grid_map, GridMap):
            raise GridMapError(f"grid_map: expected a GridMap, got {short(grid_map)}")
        frames = {frame for frame in (grid_map.frame_id, self._map.frame_id) if frame}
        if len(frames) > 1:
            raise GridMapError(
                f"grid_map: expected the frame {self._map.frame_id!r}, got {grid_map.frame_id!r}"
            )
        own = "time", *BOUNDS
        common = [name for name in self._map if name in grid_map and name not in own]
        if not common:
            raise LayerNotFoundError("elevation", tuple(grid_map))
        target = in_map_order(self._map, None)
        cells, inside = grid_map.get_indices(target.get_positions())
        if mask_layer in grid_map:
            inside &= ~np.isnan(grid_map[mask_layer][cells])
        for name in common:
            np.copyto(flat(target[name]), grid_map[name][cells], where=inside)
        hidden = in_map_order(self._hidden, None)
        state = State.of(target, hidden)
        state.heights[~np.isfinite(state.heights)] = np.nan
        least = self._parameters.min_variance
        state.variances[inside & ~(state.variances >= least)] = least
        if "elevation" in common:
            state.confirm(inside, 0.0 if self._start is None else 1e-9 * (self._last - self._start))
            state.memory.support[inside] = self._parameters.conflict_points + 1
        self._hidden = hidden
        self._map = target.with_layers(shaped(state.layers(self._parameters), target.size))

    def fused_map(self) -> GridMap:
        """Return a copy of the map that accounts for the horizontal uncertainty of cells.

        Each known cell is combined with the cells in which its true position may lie, at most four
        cells away along each axis. The weight of a cell is the probability that the true position
        lies in it. Unknown cells are ignored. The results are:

        - `elevation`, `variance`: mean and variance of the weighted cells.
        - `upper_bound`: 99 % quantile of the upper bounds of these cells.
        - `lower_bound`: 1 % quantile of the lower bounds of these cells.

        Other layers stay unchanged.

        Raises:
            ConfigError: the mapper was created without `horizontal_variances`.
        """
        wanted = self._parameters.horizontal_variances
        check(wanted, "horizontal_variances", "True for a fused map", wanted)
        names = "elevation", "variance", HORIZONTAL
        heights, variances, level = (self._map.unwrapped(name).astype(np.float64) for name in names)
        layers = horizontal.fused(heights, variances, level, self._map.resolution)
        result = in_map_order(self._map, None)
        result.update(zip(("elevation", "variance", *BOUNDS), layers, strict=True))
        return result

    # Stages

    def _advance(self, state: State, stamp: int, last: int, jump: float) -> tuple[int, int]:
        """Age all cells. Return the start of the map clock and the scan time [ns]."""
        start = stamp if self._start is None else self._start
        first = stamp if self._late is None else self._late
        self._late = first if stamp < last else None
        has_looped = stamp < last and stamp - first > LATE
        if abs(jump) > self._parameters.max_time_jump or has_looped:
            self._late = None
            text = (
                f"timestamp: expected a time within max_time_jump, "
                f"{self._parameters.max_time_jump:g} s, of {last} ns, and not before it for more "
                f"than a second, got {stamp}; the map's clock restarts"
            )
            warnings.warn(text, RuntimeWarning, stacklevel=3)
            state.confirm(~np.isnan(state.heights), 0.0)
            return stamp, stamp
        stamp = max(stamp, last)
        state.grow_older(stamp // 10**6 - last // 10**6)
        state.variances += self._parameters.time_variance * max(jump, 0.0)
        return start, stamp

    def _fuse(
        self,
        scan: Scan,
        columns: Mapping[str, NDArray[Any]],
        state: State,
        geometry: GridGeometry,
        now: float,
        clock: _Stages,
    ) -> UpdateReport:
        given, offset, cleared = self._parameters, 0.0, np.zeros(0, np.int64)
        with clock.stage("clusters"):
            on_map = np.flatnonzero(scan.cells != OUTSIDE)
            cells = scan.cells[on_map]
            threshold, spots = given.mahalanobis_distance_threshold, scan.points[:, on_map]
            heights = at_centers(spots, cells, state.heights, state.variances, geometry, threshold)
            points = sorted_by_cell(cells, heights, scan.variances[on_map], len(state.heights))
            x, y = geometry.axes_in_map_order()
            row, column = points.cells % geometry.size[0], points.cells // geometry.size[0]
            common = scan.variances_by_pose(x[row], y[column])
            clusters = clusters_of(points, common, geometry.resolution, given)
        if given.enable_drift_compensation:
            with clock.stage("drift"):
                offset = drift(clusters, state, geometry.size, given)
                state.lift(given.drift_compensation_alpha * offset)
                rest = (1.0 - given.drift_compensation_alpha) * offset
                scan, clusters = scan.lowered(rest), clusters.lowered(rest)
        with clock.stage("fusion"):
            points = clusters.points
            entries = partial(entry_heights, scan, geometry, on_map[points.order])
            fused = Fusion(clusters, state, geometry, entries, given)
            confirmed, used = points.cells[fused.is_seen], fused.used
            state.confirm(confirmed, now)
            if len(scan.horizontal):
                state.keep_horizontal(scan.horizontal[on_map], points, used)
        if given.enable_visibility_cleanup and len(scan.places):
            with clock.stage("visibility"):
                cleared = cleared_cells(scan, points, state, confirmed, geometry, given)
        if columns:
            with clock.stage("values"):
                fresh = np.zeros(len(state.heights), np.bool_)
                keeps = np.isin(fused.outcomes, (Outcome.CONFIRMED, Outcome.CONTRADICTED))
                fresh[points.cells[~keeps]] = True
                chosen, places = Chosen(points, used, fresh), scan.places[on_map]
                found = {name: column[places] for name, column in columns.items()}
                self._values.fuse(chosen, found, state.others, state.weights)
        state.heights[cleared] = np.nan
        is_certain = (state.variances <= given.largest_variance) & (state.variances < math.inf)
        is_lost = ~is_certain[points.cells[points.groups]]
        reasons = scan.dropped | {
            "outside the map": len(scan.cells) - len(on_map),
            "in cells more uncertain than max_variance": int((used & is_lost).sum()),
        }
        return UpdateReport(
            points_used=int((used & ~is_lost).sum()),
            points_dropped=sum(reasons.values()),
            points_gated=len(on_map) - int(used.sum()),
            reasons={reason: count for reason, count in reasons.items() if count},
            conflicts=int((fused.outcomes >= Outcome.RAISED).sum()),
            cells_cleared=len(cleared),
            drift=offset,
            milliseconds=clock.milliseconds,
        )


@dataclass
class _Stages:
    milliseconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        begin = time.perf_counter()
        yield
        self.milliseconds[name] = 1e3 * (time.perf_counter() - begin)


def _as_sensor(sensor: SensorModel) -> SensorModel:
    if isinstance(sensor, type):
        name = sensor.__name__
        raise GridMapError(f"sensor: expected an object, got the class. Pass {name}(), not {name}")
    if not callable(getattr(sensor, "vertical_variances", None)):
        raise GridMapError(f"sensor: expected a sensor model, got {short(sensor)}")
    return sensor


def _add_motion(
    state: State,
    old: Covariance,
    old_pose: NDArray[np.float64],
    covariance: Covariance,
    pose: NDArray[np.float64],
    geometry: GridGeometry,
) -> None:
    x, y, _ = pose[:3, 3]
    added = of_motion(old, covariance, x - old_pose[0, 3], y - old_pose[1, 3])
    rows, columns = geometry.axes_in_map_order()
    place = (rows - x)[None, :], (columns - y)[:, None]
    with np.errstate(over="ignore", invalid="ignore"):
        if added.matrix.any():
            state.variances += added.of_places(*place).ravel()
        if HORIZONTAL in state.others:
            state.others[HORIZONTAL] += added.level_of_places(*place).ravel()
