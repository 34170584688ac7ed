# SPDX-License-Identifier: BSD-3-Clause
"""Paths from the cost to a goal: extraction, shortening, and errors."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Integers, Mask, Positions, as_array, as_text
from ..errors import GeometryError, GridMapError
from ._ground import Floats, Ground, divided

_EQUAL = 1e-9  # relative difference of costs, or distance [cells], due to rounding


class PathFailure(IntEnum):
    """Reasons why there is no path, with the error codes of Nav2's action `ComputePathToPose`."""

    TF_ERROR = 202
    START_OUTSIDE_MAP = 203
    GOAL_OUTSIDE_MAP = 204
    START_OCCUPIED = 205
    GOAL_OCCUPIED = 206
    TIMEOUT = 207
    NO_VALID_PATH = 208


class NoPathError(GridMapError, ValueError):
    """A start or a goal is not on a free cell, or no path connects them.

    Attributes:
        reason: a `PathFailure`.
    """

    def __init__(self, text: str, reason: PathFailure) -> None:
        self.reason = reason
        super().__init__(text, reason)

    def whole_text(self) -> str:
        return str(self.args[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """A least-cost path.

    Attributes:
        positions: (N, 2) x, y [m], map frame, from start to goal; at most 2.3 cells apart.
        heights: (N,) height [m]; 0 if the graph has no elevation.
        yaws: (N,) direction of travel [rad]; at the ends, the yaw of the start and of the goal if
            they have one.
        length: length of the path in 3-D [m].
        cost: integral of the cost along the path, between the centers of its first and last cell.
    """

    positions: Positions
    heights: Floats
    yaws: Floats
    length: float
    cost: float


@dataclass(frozen=True, kw_only=True, eq=False)
class CostField:
    """Least cost from every cell to the nearest goal; `TravelGraph.cost_to` returns one."""

    _ground: Ground = field(repr=False)
    _free: Mask = field(repr=False)  # (S,) cells that may be a start
    _costs: Floats = field(repr=False)  # (S,)
    _next: Integers = field(repr=False)  # (S,) next cell towards the goal; negative at a goal
    _goals: dict[int, Floats] = field(repr=False)  # x, y, yaw of the goal in a cell

    @cached_property
    def costs(self) -> Floats:
        """(rows, cols) float64 in buffer order; inf where no path leads to a goal.

        `grid_map["cost_to_go"] = field.costs` also holds on a moved map.
        """
        ground = self._ground
        return np.roll(ground.in_map_order(self._costs), ground.start_index, axis=(0, 1))

    def path(self, start: ArrayLike) -> Path:
        """Return the path from a start to the nearest goal.

        The path follows the least-cost moves between cells. It is then shortened where a straight
        line is allowed and costs no more.

        Args:
            start: (2,) x, y [m], or (3,) with the yaw [rad].

        Raises:
            NoPathError: the start is outside the map, blocked or unknown, or cannot reach a goal.
        """
        pose = as_pose(start, "start")
        cell = free_cell(self._ground, self._free, pose, "start")
        if np.isinf(self._costs[cell]):
            goal = as_text(next(iter(self._goals.values()))[:2])
            target = goal if len(self._goals) == 1 else f"any of {len(self._goals)} goals"
            text = f"start: no path leads from {as_text(pose[:2])} to {target}"
            count = np.count_nonzero(np.isfinite(self._costs))
            text += f", only from {count} of {np.count_nonzero(self._free)} free cells"
            raise NoPathError(text, PathFailure.NO_VALID_PATH)
        cells = [cell]
        while (cell := self._next.item(cell)) >= 0:
            cells.append(cell)
        return _path(self._ground, self._costs, np.array(cells), pose, self._goals[cells[-1]])


def as_pose(values: ArrayLike, name: str) -> Floats:
    """Return a position (2,) or pose (3,) as (3,) x, y, yaw; without a yaw, it is NaN."""
    pose: Floats = as_array(values, np.float64, name)
    if pose.shape not in ((2,), (3,)):
        expected = "x, y of shape (2,) or x, y, yaw of shape (3,)"
        raise GeometryError(f"{name}: expected {expected}, got {pose.shape}")
    if not np.isfinite(pose).all():
        text = f"{name}: expected finite numbers, got {tuple(pose.tolist())}"
        raise NoPathError(text, _failure(name, "OUTSIDE_MAP"))
    return np.append(pose, np.nan)[:3]


def free_cell(ground: Ground, free: Mask, pose: Floats, name: str) -> int:
    """Return the flat index of the cell of a pose; raise `NoPathError` if it is not in `free`."""
    x, y = position = pose[:2].tolist()
    cell = ground.geometry.cell_at((x, y))
    if cell is None:
        text = f"{name}: expected a position on the map ({ground.geometry.place})"
        raise NoPathError(f"{text}, got {as_text(position)}", _failure(name, "OUTSIDE_MAP"))
    index = int(ground.flat(*cell))
    if free[index]:
        return index
    state = "which is blocked" if ground.known[index] else "which is unknown"
    if ground.passable[index]:
        state = "where the footprint touches a blocked cell"
    centers = ground.to_positions(ground.cells(np.flatnonzero(free)))
    distances = np.hypot(*(centers - position).T)
    hint = "The map has no free cell"
    if len(centers):
        nearest = as_text(centers[distances.argmin()])
        hint = f"The nearest free cell is at {nearest}, {distances.min():.3g} m away"
    text = f"{name}: expected a free cell, got {as_text(position)}, {state}. {hint}"
    raise NoPathError(text, _failure(name, "OCCUPIED"))


def _failure(name: str, kind: str) -> PathFailure:
    return PathFailure[f"{'START' if name == 'start' else 'GOAL'}_{kind}"]


def _path(ground: Ground, costs: Floats, cells: Integers, start: Floats, goal: Floats) -> Path:
    """Return the path along the flat indices (K,) of cells."""
    first, last = ground.to_points(np.stack([start[:2], goal[:2]])).T
    waypoints, pieces, cost = _shortened(
        ground, ground.cells(cells).astype(np.float64), costs[cells]
    )
    by_center = [False, False]
    if len(cells) == 1:
        waypoints, pieces = np.stack([first, last], axis=1), np.ones(1, np.int64)
    else:
        waypoints, pieces, by_center[0] = _with_end(ground, waypoints, pieces, 0, first)
        waypoints, pieces, by_center[1] = _with_end(ground, waypoints, pieces, -1, last)
    points, _, _ = divided(waypoints[:, :-1], waypoints[:, 1:], pieces)
    points = np.append(points, waypoints[:, -1:], axis=1)
    positions, heights = ground.to_positions(points), ground.heights_at(points)
    positions[0], positions[-1] = start[:2], goal[:2]
    x, y = np.diff(positions, axis=0).T
    yaws = np.arctan2(y, x)
    # Between the center of its cell and the start or goal, a robot does not turn.
    yaws[0], yaws[-1] = yaws[int(by_center[0])], yaws[-1 - by_center[1]]
    yaws = np.append(yaws, yaws[-1])
    for index, pose in (0, start), (-1, goal):
        yaws[index] = yaws[index] if np.isnan(pose[2]) else pose[2]
    length = float(np.hypot(np.hypot(x, y), np.diff(heights)).sum())
    return Path(positions=positions, heights=heights, yaws=yaws, length=length, cost=cost)


def _shortened(ground: Ground, waypoints: Floats, costs: Floats) -> tuple[Floats, Integers, float]:
    """Drop every waypoint whose neighbors a straight line connects at no more cost.

    Args:
        waypoints: (2, K) cells of the path.
        costs: (K,) costs to the goal.

    Returns:
        waypoints: (2, W) remaining waypoints.
        pieces: (W - 1,) number of pieces to sample each line in.
        cost: cost of the shortened path.
    """
    cost, pieces = costs[:-1] - costs[1:], np.ones(len(costs) - 1, np.int64)
    tested = np.zeros(len(costs), np.bool_)
    tested[[0, -1]] = True
    odd = 0
    # Waypoints that are not neighbors are independent, so every other one is tested at once.
    while not tested.all():
        odd = 1 - odd
        here = 2 * np.flatnonzero(~tested[odd::2]) + odd
        if not here.size:
            continue
        tested[here] = True
        most = (cost[here - 1] + cost[here]) * (1.0 + _EQUAL)
        ends = waypoints[:, here - 1], waypoints[:, here + 1]
        straight, parts = ground.straight(*ends, most)
        drops = np.isfinite(straight)
        here = here[drops]
        cost[here - 1], pieces[here - 1] = straight[drops], parts[drops]
        tested[here - 1] = tested[here + 1] = False
        tested[[0, -1]] = True
        waypoints, tested = np.delete(waypoints, here, axis=1), np.delete(tested, here)
        cost, pieces = np.delete(cost, here), np.delete(pieces, here)
    return waypoints, pieces, min(float(cost.sum()), float(costs[0]))


def _with_end(
    ground: Ground, waypoints: Floats, pieces: Integers, end: int, point: Floats
) -> tuple[Floats, Integers, bool]:
    """Replace the first (`end` 0) or last (-1) waypoint, a cell center, by a point in its cell.

    If the straight line from the point to the next waypoint is not allowed, the center remains;
    this is the third result.
    """
    if np.abs(point - waypoints[:, end]).max() <= _EQUAL:
        return waypoints, pieces, False
    line = np.stack([point, waypoints[:, 1]] if end == 0 else [waypoints[:, -2], point])
    cost, parts = ground.straight(*line[..., np.newaxis])
    if np.isfinite(cost[0]):
        waypoints[:, end], pieces[end] = point, parts[0]
        return waypoints, pieces, False
    place = 0 if end == 0 else len(pieces)
    pieces = np.insert(pieces, place, 1)
    return np.insert(waypoints, place and place + 1, point, axis=1), pieces, True
