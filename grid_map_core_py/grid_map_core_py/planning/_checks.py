# SPDX-License-Identifier: BSD-3-Clause
"""Checks whether a robot may stand at a pose or move along a path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Layer, Mask, Positions, as_array
from ..errors import ConfigError, GeometryError, short
from ..limits import check_visits
from ..map._grid_map import GridMap
from ..plugins import check
from ._footprint import Footprint, batches, touched_cells
from ._resting import NOT_RESTING, Resting, resting_pose

_FAR = 2**30
"""Row or column that is beyond every map."""

_SPAN = 2**32
"""Factor that packs a row and a column into one integer; more than the range of columns."""


@dataclass(frozen=True, eq=False)
class PathCheck:
    """Result of `check_path`.

    Attributes:
        is_free: whether the robot may move along the whole path.
        index: number of the first blocked pose; if the path is blocked between two poses, the
            number of the pose before. None if the path is free.
        pose: (3,) x, y, yaw of the first blocked pose, given or in between; None if there is none.
        blocked: (N, 2) buffer indices of the blocked cells under the footprint.
        worst: lowest known value under the footprint; NaN if there is none.
        mean: mean of the known values under the footprint, in which each cell counts once; NaN if
            there is none.
        unknown: share of unknown cells under the footprint, from 0 to 1; cells beyond the map are
            unknown.
    """

    is_free: bool
    index: int | None
    pose: Positions | None
    blocked: NDArray[np.int64]
    worst: float
    mean: float
    unknown: float


@dataclass(frozen=True, eq=False)
class PoseCheck(PathCheck):
    """Result of `check_pose`: that of a path with one pose, and how the robot rests there.

    Attributes:
        height: height of the sole at the pose [m]; like all of the following, it is NaN without
            `surface` or if no height under the footprint is known.
        roll, pitch: rotations of the sole about its x and y axes [rad], as in ROS: the roll is
            positive if the left side is higher, the pitch is positive if the front is lower.
        clearance: height of the body above the highest cell [m]; NaN without `body_height`.
    """

    height: float
    roll: float
    pitch: float
    clearance: float


def footprint_cells(grid_map: GridMap, footprint: Footprint, pose: ArrayLike) -> NDArray[np.int64]:
    """Return the cells on the map whose square the footprint touches.

    A cell that shares only its border with the footprint (up to 1e-9 m) is omitted.

    Args:
        pose: (3,) x, y [m] and yaw [rad] of the footprint, map frame.

    Returns:
        (N, 2) buffer indices, row by row in map order.

    Raises:
        GeometryError: the pose is not finite.
        LimitError: the footprint is larger than the largest permitted map.
    """
    _, row, column = _touched(grid_map, footprint, _as_poses(pose, "pose"))
    inside = _is_inside(grid_map, row, column)
    return _buffer_indices(grid_map, row[inside], column[inside])


def check_pose(
    grid_map: GridMap,
    footprint: Footprint,
    pose: ArrayLike,
    *,
    layer: str,
    limit: float,
    mean_limit: float | None = None,
    unknown: Literal["blocked", "free"] = "blocked",
    surface: str | None = None,
    max_roll: float | None = None,
    max_pitch: float | None = None,
    body_height: float | None = None,
    min_clearance: float | None = None,
) -> PoseCheck:
    """Check whether a robot may stand at a pose.

    A pose is free if no cell that the footprint touches is blocked, and if all other given limits
    hold. A cell is blocked if its value is below `limit`. It is unknown if it is beyond the map, or
    if its value (or its height in `surface`) is not finite.

    With `surface`, the robot stands on a flat sole of the size of the footprint. The sole rests on
    the plane of the facet of the convex hull of the cells' heights that is above the mean of the
    cells' centers. If the known cells are on a line, the sole is level across the line. The body is
    level, `body_height` above the sole.

    Args:
        pose: (3,) x, y [m] and yaw [rad] of the footprint, map frame.
        layer: layer in which high values are good, such as traversability.
        limit: lowest value of a free cell.
        mean_limit: lowest mean of the known values under the footprint.
        unknown: "blocked" or "free": how unknown cells count; their values never count.
        surface: layer with heights [m].
        max_roll, max_pitch: largest absolute roll and pitch of the sole [rad].
        body_height: height of the underside of the body above the sole at the pose [m].
        min_clearance: smallest height of the body above the highest cell under the footprint [m].

    Raises:
        LayerNotFoundError: a layer does not exist.
        ConfigError: a limit is NaN, or `surface` or `body_height` is missing.
        GeometryError: the pose is not finite.
        LimitError: the footprint is larger than the largest permitted map.

    Example:
        >>> grid_map = GridMap((4.0, 4.0), 0.1, layers={"traversability": 1.0})
        >>> grid_map["traversability"][grid_map.get_index((1.0, 0.0))] = 0.2
        >>> robot = Footprint.rectangle(0.9, 0.5)
        >>> check_pose(grid_map, robot, (0.0, 0.0, 0.0), layer="traversability", limit=0.5).is_free
        True
        >>> check_pose(grid_map, robot, (0.6, 0.0, 0.0), layer="traversability", limit=0.5).is_free
        False
    """
    rules = _Rules(
        layer, limit, mean_limit, unknown, surface, max_roll, max_pitch, body_height, min_clearance
    )
    poses = _as_poses(pose, "pose")
    found, rest = _check(grid_map, footprint, poses, np.zeros(1, np.int64), rules)
    return PoseCheck(**vars(found), **rest._asdict())


def check_path(
    grid_map: GridMap,
    footprint: Footprint,
    poses: ArrayLike,
    *,
    layer: str,
    limit: float,
    mean_limit: float | None = None,
    unknown: Literal["blocked", "free"] = "blocked",
    surface: str | None = None,
    max_roll: float | None = None,
    max_pitch: float | None = None,
    body_height: float | None = None,
    min_clearance: float | None = None,
) -> PathCheck:
    """Check whether a robot may move along a path.

    Between two poses, the robot moves straight ahead and turns evenly, the shorter way round (half
    a turn: counter-clockwise). Poses are checked so close to each other that no corner of the
    footprint moves by more than half a cell in between. An obstacle that comes at least a quarter
    of a cell inside the footprint is therefore found.

    Args:
        poses: (N, 3) x, y [m] and yaw [rad] of the footprint along the path, map frame.
        layer, ..., min_clearance: as for `check_pose`; the limits hold at each pose.

    Raises:
        LayerNotFoundError, ConfigError: as for `check_pose`.
        GeometryError: there is no pose, or a pose is not finite.
        LimitError: the footprint or the path is too large.
    """
    rules = _Rules(
        layer, limit, mean_limit, unknown, surface, max_roll, max_pitch, body_height, min_clearance
    )
    samples, indices = _between(_as_poses(poses, "poses"), footprint, grid_map.resolution)
    return _check(grid_map, footprint, samples, indices, rules)[0]


@dataclass(frozen=True)
class _Rules:
    """Arguments of `check_pose` and `check_path`."""

    layer: str
    limit: float
    mean_limit: float | None = None
    unknown: str = "blocked"
    surface: str | None = None
    max_roll: float | None = None
    max_pitch: float | None = None
    body_height: float | None = None
    min_clearance: float | None = None

    def __post_init__(self) -> None:
        of_sole = "max_roll", "max_pitch", "min_clearance", "body_height"
        for name in ("limit", "mean_limit", *of_sole):
            value = getattr(self, name)
            is_number = isinstance(value, int | float | np.integer | np.floating)
            is_default = value is None and name != "limit"
            check(is_default or (is_number and value == value), name, "a number", value)
        known = self.unknown in ("blocked", "free")
        check(known, "unknown", "'blocked' or 'free'", self.unknown)
        for name in of_sole:
            if self.surface is None and getattr(self, name) is not None:
                raise ConfigError(f"{name}: expected `surface`, the layer with heights, as well")
        if self.min_clearance is not None and self.body_height is None:
            raise ConfigError("min_clearance: expected `body_height` as well")

    def refuse(self, rest: Resting) -> bool:
        """Return whether a resting pose is beyond a limit; NaN is not."""
        return (
            (self.max_roll is not None and abs(rest.roll) > self.max_roll)
            or (self.max_pitch is not None and abs(rest.pitch) > self.max_pitch)
            or (self.min_clearance is not None and rest.clearance < self.min_clearance)
        )


def _check(
    grid_map: GridMap, footprint: Footprint, poses: Positions, indices: Integers, rules: _Rules
) -> tuple[PathCheck, Resting]:
    """Check poses (P, 3) with the numbers `indices` (P,); also return how the last one rests."""
    touched, is_blocked, rest = [], np.zeros(len(poses), np.bool_), NOT_RESTING
    for part in batches(footprint, grid_map.resolution, len(poses)):
        pose, row, column = _touched(grid_map, footprint, poses[part])
        touched.append(np.unique(row * _SPAN + column))
        values, heights, known, blocked = _ground(grid_map, rules, row, column)
        count = part.stop - part.start
        is_blocked[part] = np.bincount(pose, blocked, count) > 0
        if rules.mean_limit is not None:
            sums = np.bincount(pose, np.where(known, values, 0.0), count)
            with np.errstate(invalid="ignore"):
                means = (sums / np.bincount(pose, known, count)).astype(np.float32)
            is_blocked[part] |= means < np.float32(rules.mean_limit)
        if rules.surface is not None:
            cells = np.stack([row, column], axis=1)[has_height := np.isfinite(heights)]
            places = grid_map.geometry.corner - (cells + 0.5) * grid_map.resolution
            ends = np.searchsorted(pose[has_height], np.arange(count + 1))
            points = np.column_stack([places, heights[has_height]])
            for number, one in enumerate(poses[part]):
                here = points[ends[number] : ends[number + 1]] - (*one[:2], 0.0)
                rest = resting_pose(here, one[2], grid_map.resolution, rules.body_height)
                is_blocked[part.start + number] |= rules.refuse(rest)
    row, column = np.divmod(np.unique(np.concatenate(touched)) + _SPAN // 2, _SPAN)
    column -= _SPAN // 2
    values, _, known, blocked = _ground(grid_map, rules, row, column)
    blocked &= _is_inside(grid_map, row, column)
    is_free, first, values = not is_blocked.any(), int(is_blocked.argmax()), values[known]
    found = PathCheck(
        is_free=is_free,
        index=None if is_free else int(indices[first]),
        pose=None if is_free else poses[first],
        blocked=_buffer_indices(grid_map, row[blocked], column[blocked]),
        worst=float(values.min()) if values.size else math.nan,
        mean=float(values.mean(dtype=np.float64)) if values.size else math.nan,
        unknown=1.0 - values.size / known.size,
    )
    return found, rest


def _ground(
    grid_map: GridMap, rules: _Rules, row: Integers, column: Integers
) -> tuple[Layer, Layer, Mask, Mask]:
    """Return values, heights, and which cells are known and blocked; NaN beyond the map."""
    inside = _is_inside(grid_map, row, column)
    cells = tuple(_buffer_indices(grid_map, row[inside], column[inside]).T)
    values, heights = np.full((2, len(row)), np.nan, np.float32)
    values[inside] = grid_map[rules.layer][cells]
    known = np.isfinite(values)
    if rules.surface is not None:
        heights[inside] = grid_map[rules.surface][cells]
        known &= np.isfinite(heights)
    # In float32, a value that was set to the limit is not below it.
    blocked = known & (values < np.float32(rules.limit))
    return values, heights, known, (blocked if rules.unknown == "free" else blocked | ~known)


def _as_poses(values: ArrayLike, name: str) -> Positions:
    """Return poses x, y, yaw as (P, 3); the parameter `pose` is a single one."""
    poses: Positions = as_array(values, np.float64, name)
    is_one = name == "pose"
    if poses.shape[-1:] != (3,) or poses.ndim != 2 - is_one or not poses.size:
        shape = "(3,)" if is_one else "(N, 3), N > 0"
        raise GeometryError(f"{name}: expected x, y, yaw of shape {shape}, got {poses.shape}")
    if not np.isfinite(poses).all():
        raise GeometryError(f"{name}: expected finite x, y, yaw [m, m, rad], got {short(values)}")
    return poses.reshape(-1, 3)


def _between(
    poses: Positions, footprint: Footprint, resolution: float
) -> tuple[Positions, Integers]:
    """Return poses (P, 3) along a path, and for each the number of the given pose before (P,)."""
    moves = np.diff(poses, axis=0, append=poses[-1:])
    moves[:, 2] = math.pi - (math.pi - moves[:, 2]) % (2.0 * math.pi)
    farthest = np.hypot(moves[:, 0], moves[:, 1]) + footprint.radius * np.abs(moves[:, 2])
    steps = np.fmax(np.ceil(farthest / (0.5 * resolution)), 1.0)
    check_visits("poses", float(steps.sum()) * (2.0 * footprint.radius / resolution) ** 2)
    counts = steps.astype(np.int64)
    indices = np.repeat(np.arange(len(poses)), counts)
    shares = (np.arange(len(indices)) - (np.cumsum(counts) - counts)[indices]) / counts[indices]
    return poses[indices] + shares[:, np.newaxis] * moves[indices], indices


def _touched(
    grid_map: GridMap, footprint: Footprint, poses: Positions
) -> tuple[Integers, Integers, Integers]:
    """Return number of the pose, row and column of the cells under poses (P, 3)."""
    origins = (grid_map.geometry.corner - poses[:, :2]) / grid_map.resolution
    return touched_cells(footprint, grid_map.resolution, origins.clip(-_FAR, _FAR), poses[:, 2])


def _is_inside(grid_map: GridMap, row: Integers, column: Integers) -> Mask:
    rows, columns = grid_map.size
    return (row >= 0) & (row < rows) & (column >= 0) & (column < columns)


def _buffer_indices(grid_map: GridMap, row: Integers, column: Integers) -> NDArray[np.int64]:
    """Return cells of the map, in map order, as (N, 2) buffer indices."""
    indices = np.stack([row, column], axis=1) + grid_map.start_index
    return np.where(indices < grid_map.size, indices, indices - grid_map.size)
