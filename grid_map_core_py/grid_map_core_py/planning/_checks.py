# SPDX-License-Identifier: BSD-3-Clause
"""Checks whether a robot may stand at a pose or move along a path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Layer, Mask, Positions, Size, as_array
from .._arrays._pieces import expanded
from ..errors import ConfigError, GeometryError, short
from ..limits import check_visits
from ..map import _ring_buffer as ring_buffer
from ..map._grid_map import GridMap
from ..plugins import check
from ._footprint import Footprint, Runs, touched_runs
from ._resting import NOT_RESTING, Resting, resting_pose

_FAR = 2.0**40
"""Coordinate [cells] that is beyond every map, and at which float64 still counts cells."""

_CELLS = 2**18  # cells under footprints that are looked at together

_NONE = np.empty(0, np.int64)

Unknown = Literal["blocked", "free"]


@dataclass(frozen=True, eq=False)
class PoseCheck:
    """Result of `check_pose`.

    Attributes:
        is_free: whether the robot may stand there.
        blocked: (N, 2) buffer indices of the blocked cells under the footprint.
        worst: lowest known value under the footprint; NaN if there is none.
        mean: mean of the known values under the footprint; NaN if there is none.
        unknown: share of unknown cells under the footprint, from 0 to 1; cells beyond the map are
            unknown.
        height: height of the sole at the pose [m]; like all of the following, it is NaN without
            `surface` or if no height under the footprint is known.
        roll, pitch: rotations of the sole about its x and y axes [rad], as in ROS: the roll is
            positive if the left side is higher, the pitch is positive if the front is lower.
        clearance: height of the body above the highest cell [m]; NaN without `body_height`.
    """

    is_free: bool
    blocked: NDArray[np.int64]
    worst: float
    mean: float
    unknown: float
    height: float
    roll: float
    pitch: float
    clearance: float


@dataclass(frozen=True, eq=False)
class PathCheck:
    """Result of `check_path`.

    Attributes:
        is_free: whether the robot may move along the whole path.
        index: number of the first blocked pose; if the path is blocked between two poses, the
            number of the pose before. None if the path is free.
        pose: (3,) x, y, yaw of the first blocked pose, given or in between; None if there is none.
        blocked: (N, 2) buffer indices of the blocked cells under the path.
        worst: lowest known value under the path; NaN if there is none.
        mean: mean of the known values under the path, in which each cell counts once; NaN if there
            is none.
        unknown: share of unknown cells under the path, from 0 to 1; cells beyond the map are
            unknown.
        roll, pitch: largest absolute roll and pitch on the path [rad]; NaN without `surface`.
        clearance: smallest clearance on the path [m]; NaN without `body_height`.
    """

    is_free: bool
    index: int | None
    pose: Positions | None
    blocked: NDArray[np.int64]
    worst: float
    mean: float
    unknown: float
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
    runs, _ = _on_map(grid_map, _runs_of(grid_map, footprint, _as_poses(pose, "pose")))
    lengths = runs.stop - runs.first
    rows = np.repeat(runs.row, lengths)
    columns = np.concatenate([_NONE, *map(np.arange, runs.first, runs.stop)])
    return _buffer_indices(grid_map, (0, 0), rows, columns)


def check_pose(
    grid_map: GridMap,
    footprint: Footprint,
    pose: ArrayLike,
    *,
    layer: str,
    limit: float,
    mean_limit: float | None = None,
    unknown: Unknown = "blocked",
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
    found = _check(grid_map, footprint, _as_poses(pose, "pose"), rules)
    rest = found.rests[0] if found.rests else NOT_RESTING
    return PoseCheck(not found.is_blocked[0], *found.cells, *rest)


def check_path(
    grid_map: GridMap,
    footprint: Footprint,
    poses: ArrayLike,
    *,
    layer: str,
    limit: float,
    mean_limit: float | None = None,
    unknown: Unknown = "blocked",
    surface: str | None = None,
    max_roll: float | None = None,
    max_pitch: float | None = None,
    body_height: float | None = None,
    min_clearance: float | None = None,
) -> PathCheck:
    """Check whether a robot may move along a path.

    Between two poses, the robot moves straight ahead and turns evenly, the shorter way round (half
    a turn: counter-clockwise). Poses are checked as by `check_pose`, so close to each other that no
    corner of the footprint moves by more than half a cell in between. An obstacle that comes at
    least a quarter of a cell inside the footprint is therefore found.

    Args:
        poses: (N, 3) x, y [m] and yaw [rad] of the footprint along the path, map frame.
        layer: layer in which high values are good, such as traversability.
        limit: lowest value of a free cell.
        mean_limit: lowest mean of the known values under the footprint, at each pose.
        unknown: "blocked" or "free": how unknown cells count; their values never count.
        surface: layer with heights [m].
        max_roll, max_pitch: largest absolute roll and pitch of the sole [rad].
        body_height: height of the underside of the body above the sole at the pose [m].
        min_clearance: smallest height of the body above the highest cell under the footprint [m].

    Raises:
        LayerNotFoundError: a layer does not exist.
        ConfigError: a limit is NaN, or `surface` or `body_height` is missing.
        GeometryError: there is no pose, or a pose is not finite.
        LimitError: the footprint or the path is too large.
    """
    rules = _Rules(
        layer, limit, mean_limit, unknown, surface, max_roll, max_pitch, body_height, min_clearance
    )
    samples, indices = _between(_as_poses(poses, "poses"), footprint, grid_map.resolution)
    found = _check(grid_map, footprint, samples, rules)
    first = int(np.argmax(found.is_blocked))
    is_free = not found.is_blocked[first]
    rests = np.array(found.rests or [NOT_RESTING])
    roll, pitch = np.fmax.reduce(np.abs(rests[:, 1:3])).tolist()
    return PathCheck(
        is_free,
        None if is_free else int(indices[first]),
        None if is_free else samples[first],
        *found.cells,
        roll,
        pitch,
        float(np.fmin.reduce(rests[:, 3])),
    )


@dataclass(frozen=True)
class _Rules:
    """Arguments of `check_pose` and `check_path`."""

    layer: str
    limit: float
    mean_limit: float | None
    unknown: str
    surface: str | None
    max_roll: float | None
    max_pitch: float | None
    body_height: float | None
    min_clearance: float | None

    def __post_init__(self) -> None:
        for name in ("limit", "mean_limit", *_TILTS, "body_height"):
            value = getattr(self, name)
            is_number = isinstance(value, int | float | np.integer | np.floating)
            check(value is None or (is_number and value == value), name, "a number", value)
        check(self.limit is not None, "limit", "a number", self.limit)
        known = self.unknown in ("blocked", "free")
        check(known, "unknown", "'blocked' or 'free'", self.unknown)
        for name in (*_TILTS, "body_height"):
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


_TILTS = ("max_roll", "max_pitch", "min_clearance")


class _Cells(NamedTuple):
    """Summary of the cells under all poses; see `PathCheck`."""

    blocked: NDArray[np.int64]
    worst: float
    mean: float
    unknown: float


class _Found(NamedTuple):
    """Result of a check of (P,) poses; `rests` is empty without a surface."""

    is_blocked: Mask
    cells: _Cells
    rests: list[Resting]


class _Ground(NamedTuple):
    """The block of the map that contains all cells under the poses, in map order.

    Attributes:
        corner: row and column of its first cell in the map.
        values: (rows, cols) values of the checked layer.
        known, blocked: (rows, cols) which cells are known, and which are blocked.
        heights: (rows, cols) heights [m]; None without a surface.
    """

    corner: Size
    values: Layer
    known: Mask
    blocked: Mask
    heights: Layer | None


def _check(grid_map: GridMap, footprint: Footprint, poses: Positions, rules: _Rules) -> _Found:
    all_runs = _runs_of(grid_map, footprint, poses)
    runs, leaves = _on_map(grid_map, all_runs)
    ground = _ground(grid_map, runs, rules)
    touched, is_blocked = _touched(ground, runs, len(poses), rules.mean_limit)
    if rules.unknown == "blocked":
        is_blocked[all_runs.pose[leaves]] = True
    rests = [] if ground.heights is None else _rests(grid_map, ground, runs, poses, rules)
    for number, rest in enumerate(rests):
        is_blocked[number] |= rules.refuse(rest)
    values = ground.values[touched & ground.known]
    total = _area(all_runs) if leaves.any() else np.count_nonzero(touched)
    cells = _Cells(
        _buffer_indices(grid_map, ground.corner, *np.nonzero(touched & ground.blocked)),
        float(values.min(initial=np.inf)) if values.size else math.nan,
        float(values.mean(dtype=np.float64)) if values.size else math.nan,
        1.0 - values.size / float(total),
    )
    return _Found(is_blocked, cells, rests)


def _ground(grid_map: GridMap, runs: Runs, rules: _Rules) -> _Ground:
    block, corner = (slice(0, 0), slice(0, 0)), (0, 0)
    if len(runs.row):
        corner = int(runs.row.min()), int(runs.first.min())
        block = slice(corner[0], int(runs.row.max()) + 1), slice(corner[1], int(runs.stop.max()))
    start = grid_map.start_index
    values = ring_buffer.block(grid_map[rules.layer], start, *block)
    known, heights = np.isfinite(values), None
    if rules.surface is not None:
        heights = ring_buffer.block(grid_map[rules.surface], start, *block)
        known &= np.isfinite(heights)
    # In float32, a value that was set to the limit is not below it.
    blocked = known & (values < np.float32(rules.limit))
    if rules.unknown == "blocked":
        blocked |= ~known
    return _Ground(corner, values, known, blocked, heights)


def _touched(
    ground: _Ground, runs: Runs, count: int, mean_limit: float | None
) -> tuple[Mask, Mask]:
    """Return which cells any pose touches, and which of the `count` poses are blocked."""
    # Flat arrays, column by column: indexing them is twice as fast.
    values, known, blocked = (layer.ravel("F") for layer in ground[1:4])
    rows = len(ground.values)
    begins = (runs.first - ground.corner[1]) * rows + runs.row - ground.corner[0]
    touched, is_blocked = np.zeros(values.size, np.bool_), np.zeros(count, np.bool_)
    sums, counts = np.zeros((2, count))
    for run, offset in expanded(runs.stop - runs.first, _CELLS):
        cells = begins[run] + rows * offset
        touched[cells] = True
        is_blocked[runs.pose[run[blocked[cells]]]] = True
        if mean_limit is not None:
            pose, is_known = runs.pose[run], known[cells]
            sums += np.bincount(pose, np.where(is_known, values[cells], 0.0), count)
            counts += np.bincount(pose, is_known, count)
    if mean_limit is not None:
        with np.errstate(invalid="ignore"):
            is_blocked |= (sums / counts).astype(np.float32) < np.float32(mean_limit)
    return touched.reshape(ground.known.shape, order="F"), is_blocked


def _rests(
    grid_map: GridMap, ground: _Ground, runs: Runs, poses: Positions, rules: _Rules
) -> list[Resting]:
    """Return how the sole rests at each pose; only called with a surface."""
    assert ground.heights is not None
    x, y = grid_map.geometry.axes_in_map_order()
    body_height = math.nan if rules.body_height is None else rules.body_height
    ends = np.searchsorted(runs.pose, np.arange(len(poses) + 1))
    rests = []
    for begin, end, pose in zip(ends[:-1], ends[1:], poses, strict=True):
        first, stop = runs.first[begin:end], runs.stop[begin:end]
        row = np.repeat(runs.row[begin:end], stop - first)
        column = np.concatenate([_NONE, *map(np.arange, first, stop)])
        heights = ground.heights[row - ground.corner[0], column - ground.corner[1]]
        points = np.stack([x[row] - pose[0], y[column] - pose[1], heights], axis=1)
        points = points[np.isfinite(heights)]
        rests.append(resting_pose(points, pose[2], grid_map.resolution, body_height))
    return rests


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
    moves = np.diff(poses, axis=0)
    moves[:, 2] = math.pi - (math.pi - moves[:, 2]) % (2.0 * math.pi)
    farthest = np.hypot(moves[:, 0], moves[:, 1]) + footprint.radius * np.abs(moves[:, 2])
    steps = np.fmax(np.ceil(farthest / (0.5 * resolution)), 1.0)
    check_visits("poses", float(steps.sum() + 1.0) * (2.0 * footprint.radius / resolution) ** 2)
    counts = np.append(steps, 1.0).astype(np.int64)
    indices = np.repeat(np.arange(len(poses)), counts)
    number = np.arange(len(indices)) - np.repeat(np.cumsum(counts) - counts, counts)
    shares = number / counts[indices]
    moves = np.concatenate((moves, np.zeros((1, 3))))
    return poses[indices] + shares[:, None] * moves[indices], indices


def _runs_of(grid_map: GridMap, footprint: Footprint, poses: Positions) -> Runs:
    geometry = grid_map.geometry
    origins = (geometry.corner - poses[:, :2]) / geometry.resolution
    return touched_runs(footprint, geometry.resolution, np.clip(origins, -_FAR, _FAR), poses[:, 2])


def _on_map(grid_map: GridMap, runs: Runs) -> tuple[Runs, Mask]:
    """Return the parts of the runs on the map, and which runs (M,) have cells beyond the map."""
    rows, columns = grid_map.size
    pose, row, first, stop = runs
    begin, end = np.maximum(first, 0), np.minimum(stop, columns)
    inside = (row >= 0) & (row < rows) & (begin < end)
    leaves = ~inside | (begin > first) | (end < stop)
    return Runs(pose[inside], row[inside], begin[inside], end[inside]), leaves


def _area(runs: Runs) -> int:
    """Return the number of different cells of runs."""
    order = np.lexsort((runs.first, runs.row))
    lowest = runs.first.min()
    lines = (runs.row[order] - runs.row.min()) * (runs.stop.max() - lowest)
    begins, ends = lines + runs.first[order] - lowest, lines + runs.stop[order] - lowest
    # Each run counts its cells beyond the ends of the runs before.
    before = np.maximum.accumulate(np.append(0, ends[:-1]))
    return int(np.maximum(ends - np.maximum(begins, before), 0).sum())


def _buffer_indices(
    grid_map: GridMap, corner: Size, rows: Integers, columns: Integers
) -> NDArray[np.int64]:
    """Return cells as (N, 2) buffer indices, given rows and columns counted from `corner`."""
    indices = np.stack((rows, columns), axis=1) + corner + grid_map.start_index
    indices %= grid_map.size
    return indices
