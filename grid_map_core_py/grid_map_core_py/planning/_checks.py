# SPDX-License-Identifier: BSD-3-Clause
"""Checks whether a robot may stand at a pose or move along a path."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Integers, Layer, Mask, Positions, as_array, as_number
from ..errors import GeometryError, short
from ..limits import check_visits
from ..map._grid_map import GridMap
from ..plugins import check
from ._footprint import Footprint, touched_cells
from ._ground import divided


@dataclass(frozen=True, eq=False)
class PathCheck:
    """Result of `check_path`.

    Attributes:
        is_free: whether the robot may move along the whole path.
        index: index of the first blocked pose. If the path is blocked between two poses, the index
            of the first of them. None if the path is free.
        pose: (3,) x, y, yaw where the path is first blocked; None if the path is free.
        blocked: (N, 2) buffer indices of the blocked cells under the footprint.
        worst: lowest known value under the footprint; NaN if no value is known.
        mean: mean of the known values under the footprint; NaN if no value is known. Each cell
            counts once, even if several poses touch it.
        unknown: share of cells under the footprint that are unknown, 0 to 1. Cells outside the map
            are unknown.
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
    """Result of `check_pose`: the attributes of `PathCheck`, and the pose of the robot's sole.

    The sole is a flat area with the outline of the footprint, as described for `check_pose`. The
    attributes below are NaN if `surface` is not given or no height under the footprint is known.

    Attributes:
        height: height of the sole at the pose [m].
        roll, pitch: rotations of the sole about its x and y axes [rad], as in ROS. The roll is
            positive if the left side is higher. The pitch is positive if the front is lower.
        clearance: height of the body above the highest cell under the footprint [m]. It is also NaN
            if `body_height` is not given.
    """

    height: float
    roll: float
    pitch: float
    clearance: float


def footprint_cells(grid_map: GridMap, footprint: Footprint, pose: ArrayLike) -> NDArray[np.int64]:
    """Return the cells of a map that a footprint touches.

    A cell is omitted if it shares only its border with the footprint, up to 1e-9 m.

    Args:
        pose: (3,) x, y [m] and yaw [rad] of the footprint, map frame.

    Returns:
        (N, 2) buffer indices, row by row in map order.

    Raises:
        GeometryError: the pose is not finite.
        LimitError: the footprint is larger than the largest permitted map.
    """
    ((_, _, cells),) = touched_cells(footprint, grid_map.geometry, _as_poses(pose, "pose", 1))
    indices, inside = _on_map(grid_map, cells)
    return indices[:, inside].T


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

    A cell is blocked if its value is below `limit`. A cell is unknown if it is outside the map, or
    if its value or its height is not finite. A pose is free if the footprint touches no blocked
    cell and all other given limits hold.

    With `surface`, the robot stands on a flat sole with the outline of the footprint. The sole
    rests on the convex hull of the known heights under the footprint. It lies in the plane of the
    upper facet at the mean position of the known cells. If these cells are on a line, the sole is
    level across the line. The underside of the body is level.

    Args:
        pose: (3,) x, y [m] and yaw [rad] of the footprint, map frame.
        layer: layer in which high values are good, such as traversability.
        limit: lowest value of a free cell.
        mean_limit: lowest mean of the known values under the footprint.
        unknown: whether unknown cells are "blocked" or "free"; their values are always ignored.
        surface: layer with heights [m].
        max_roll, max_pitch: largest absolute roll and pitch of the sole [rad].
        body_height: height of the underside of the body above the sole at the pose [m].
        min_clearance: smallest height of the body above the highest cell under the footprint [m].

    Raises:
        LayerNotFoundError: a layer does not exist.
        ConfigError: an argument is invalid, or it requires another argument that is not given.
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
    poses = _as_poses(pose, "pose", 1)
    found, rest = _check(grid_map, footprint, poses, np.zeros(1, np.int64), rules)
    height, roll, pitch, clearance = rest
    return PoseCheck(**vars(found), height=height, roll=roll, pitch=pitch, clearance=clearance)


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

    Between two poses, the robot moves along a straight line and turns at a constant rate. It turns
    in the shorter direction; half a turn is counter-clockwise. Intermediate poses are checked too.
    From one checked pose to the next, each corner of the footprint moves by at most half a cell.
    The check therefore finds every obstacle that reaches at least a quarter of a cell into the
    footprint.

    Args:
        poses: (N, 3) x, y [m] and yaw [rad] of the footprint along the path, map frame.
        layer, ..., min_clearance: as for `check_pose`; the limits apply to each pose.

    Raises:
        LayerNotFoundError, ConfigError: as for `check_pose`.
        GeometryError: there is no pose, or a pose is not finite.
        LimitError: the footprint or the path is too large.
    """
    rules = _Rules(
        layer, limit, mean_limit, unknown, surface, max_roll, max_pitch, body_height, min_clearance
    )
    given, resolution = _as_poses(poses, "poses", 2), grid_map.resolution
    moves = np.diff(given, axis=0)
    moves[:, 2] = math.pi - (math.pi - moves[:, 2]) % (2.0 * math.pi)
    farthest = np.hypot(moves[:, 0], moves[:, 1]) + footprint.radius * np.abs(moves[:, 2])
    steps = np.fmax(np.ceil(farthest / (0.5 * resolution)), 1.0)
    check_visits("poses", float(steps.sum()) * (2.0 * footprint.radius / resolution) ** 2)
    between, _, index = divided(given[:-1].T, given[:-1].T + moves.T, steps)
    samples = np.append(between, given[-1:].T, axis=1).T
    return _check(grid_map, footprint, samples, np.append(index, len(moves)), rules)[0]


@dataclass(frozen=True)
class _Rules:
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
        texts = {"layer", "unknown", "surface"}
        numbers = {name: value for name, value in vars(self).items() if name not in texts}
        given = {name for name, value in numbers.items() if value is not None} | {"limit"}
        for name in given:
            check(not math.isnan(as_number(numbers[name], name)), name, "a number", numbers[name])
        of_sole = sorted(given - {"limit", "mean_limit"})
        expected = f"a layer with heights, for {', '.join(of_sole)}"
        check(self.surface is not None or not of_sole, "surface", expected, self.surface)
        has_body = self.body_height is not None or self.min_clearance is None
        check(has_body, "body_height", "a height, for min_clearance", self.body_height)
        is_known = self.unknown in ("blocked", "free")
        check(is_known, "unknown", "'blocked' or 'free'", self.unknown)


def _check(
    grid_map: GridMap, footprint: Footprint, poses: Positions, indices: Integers, rules: _Rules
) -> tuple[PathCheck, list[float]]:
    """Return the `PathCheck`, and height, roll, pitch and clearance at the last pose.

    `indices` (P,) holds the index of each pose or its predecessor in the original path.
    """
    is_blocked, union = np.zeros(len(poses), np.bool_), []
    rests = np.full((4, len(poses)), np.nan)
    # None becomes NaN, which is no limit.
    *steepest, least_clearance, body_height = np.array(
        [rules.max_roll, rules.max_pitch, rules.min_clearance, rules.body_height], np.float64
    )
    for batch, pose, cells in touched_cells(footprint, grid_map.geometry, poses):
        union.append(_distinct(cells))
        values, heights, blocked = _look_up(grid_map, rules, cells)
        is_blocked[batch][pose[blocked]] = True
        if rules.mean_limit is not None:
            known, count = np.isfinite(values), batch.stop - batch.start
            sums = np.bincount(pose[known], values[known], count)
            with np.errstate(invalid="ignore"):
                means = sums / np.bincount(pose[known], minlength=count)
            is_blocked[batch] |= means.astype(np.float32) < np.float32(rules.mean_limit)
        if rules.surface is not None:
            places = grid_map.geometry.corner - (cells.T + 0.5) * grid_map.resolution
            points = np.column_stack([places, heights])
            for number, (x, y, yaw) in enumerate(poses[batch]):
                under = points[(pose == number) & np.isfinite(heights)] - (x, y, 0.0)
                if len(under):
                    height, roll, pitch = _resting(under, yaw, grid_map.resolution)
                    clearance = height + body_height - under[:, 2].max()
                    rests[:, batch.start + number] = height, roll, pitch, clearance
    is_blocked |= (np.abs(rests[1:3].T) > steepest).any(axis=1) | (rests[3] < least_clearance)
    cells = _distinct(np.concatenate(union, axis=1))
    values, _, blocked = _look_up(grid_map, rules, cells)
    buffer_indices, inside = _on_map(grid_map, cells)
    is_free, first = not is_blocked.any(), int(is_blocked.argmax())
    known = values[np.isfinite(values)]
    found = PathCheck(
        is_free=is_free,
        index=None if is_free else int(indices[first]),
        pose=None if is_free else poses[first],
        blocked=buffer_indices[:, blocked & inside].T,
        worst=float(known.min()) if known.size else math.nan,
        mean=float(known.mean(dtype=np.float64)) if known.size else math.nan,
        unknown=1.0 - known.size / values.size,
    )
    return found, rests[:, -1].tolist()


def _distinct(cells: Integers) -> Integers:
    _, first = np.unique(cells[0] * 2**32 + cells[1], return_index=True)
    return cells[:, first]


def _on_map(grid_map: GridMap, cells: Integers) -> tuple[Integers, Mask]:
    """Return buffer indices (2, N) of cells in map order, and a mask of cells on the map."""
    size, start = np.array([grid_map.size, grid_map.start_index])[..., np.newaxis]
    return (cells + start) % size, ((cells >= 0) & (cells < size)).all(axis=0)


def _look_up(grid_map: GridMap, rules: _Rules, cells: Integers) -> tuple[Layer, Layer, Mask]:
    """Return values and heights (N,) of cells, NaN if unknown, and a mask of blocked cells."""
    (row, column), known = _on_map(grid_map, cells)
    heights = np.full(len(row), np.nan, np.float32)
    if rules.surface is not None:
        heights[known] = grid_map[rules.surface][row, column][known]
        known = np.isfinite(heights)
    values = grid_map[rules.layer][row, column]
    known = known & np.isfinite(values)
    # In float32, a value that was set to the limit is not below it.
    blocked = np.where(known, values < np.float32(rules.limit), rules.unknown == "blocked")
    return np.where(known, values, np.float32(np.nan)), heights, blocked


def _resting(points: Positions, yaw: float, resolution: float) -> tuple[float, float, float]:
    """Return height [m], roll and pitch [rad] of a sole on points (N, 3) around the robot."""
    from scipy.spatial import ConvexHull  # slow to import

    middle, top = points[:, :2].mean(axis=0), points[:, 2].max()
    local = (points - (*middle, top)) / resolution
    spreads, directions = np.linalg.eigh(local[:, :2].T @ local[:, :2])
    # Points on a line spread in one direction only.
    for direction in directions.T[spreads <= 1e-9 * max(spreads[1], 1.0)]:
        across = np.append(direction, 0.0)
        local = np.concatenate((local + across, local - across))
    # With a point below the others, the hull of level ground has a volume, too.
    below = 0.0, 0.0, local[:, 2].min() - 1.0
    equations = ConvexHull(np.concatenate((local, [below]))).equations
    upper = equations[equations[:, 2] > 0.0]
    # The hull is convex, so the upper facet at a position has the lowest of all upper planes.
    x, y, z, offset = upper[np.argmin(-upper[:, 3] / upper[:, 2])]
    slope = -np.array([x, y]) / z
    height = float(top - resolution * offset / z - slope @ middle)
    ahead = slope @ (math.cos(yaw), math.sin(yaw))
    left = slope @ (-math.sin(yaw), math.cos(yaw))
    # The normal (-ahead, -left, 1) is the z axis turned by the roll, then by the pitch.
    roll = math.asin(left / math.sqrt(1.0 + ahead**2 + left**2))
    return height, roll, -math.atan(ahead)


def _as_poses(values: ArrayLike, name: str, axes: int) -> Positions:
    """Validate a pose (3,) or poses (N, 3), and return poses (P, 3)."""
    poses: Positions = as_array(values, np.float64, name)
    is_finite = poses.size and np.isfinite(poses).all()
    if poses.ndim != axes or poses.shape[-1] != 3 or not is_finite:
        shape = "(3,)" if axes == 1 else "(N, 3), N > 0"
        expected = f"finite x, y, yaw [m, m, rad] of shape {shape}"
        raise GeometryError(f"{name}: expected {expected}, got {short(values)}")
    return poses.reshape(-1, 3)
