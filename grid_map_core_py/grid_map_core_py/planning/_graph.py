# SPDX-License-Identifier: BSD-3-Clause
"""A graph of the moves between cells of a map, and least costs in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, dijkstra

from .._arrays._checks import Mask, as_array, as_finite, as_number, as_text
from ..errors import ConfigError, GeometryError, short
from ..map._grid_map import GridMap
from ._footprint import Footprint
from ._ground import BORDER, ROUNDING, VERTICAL, Floats, Ground, Steepness, padded
from ._paths import CostField, NoPathError, Path, PathFailure, as_pose, free_cell

Move: TypeAlias = tuple[int, int]

_SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))
_DIAGONALS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
_KNIGHT = tuple((a * i, b * j) for i, j in ((2, 1), (1, 2)) for a, b in _DIAGONALS)
_MOVES: dict[int, tuple[Move, ...]] = {
    8: (*_SIDES, *_DIAGONALS),
    16: (*_SIDES, *_DIAGONALS, *_KNIGHT),
}
"""Rows and columns that a move goes, by the number of neighbors."""

_HIGHEST_COST = 252.0  # highest cost of Nav2 at which the robot is not in collision


@dataclass(frozen=True)
class SlopeLimits:
    """Steepest slopes that a robot can travel [rad], from 0 to pi / 2, which means no limit.

    Attributes:
        up: slope along the path, upwards.
        down: slope along the path, downwards; also positive.
        cross: slope across the path, to either side.
    """

    up: float
    down: float
    cross: float

    def __post_init__(self) -> None:
        for name, angle in vars(self).items():
            if not 0.0 <= as_number(angle, name) <= math.pi / 2.0:
                text = f"{name}: expected an angle from 0 to pi / 2 [rad], got {short(angle)}"
                raise GeometryError(f"{text}. Convert degrees with math.radians")


class TravelGraph:
    """Moves of a robot between the cells of a map, with their costs.

    Cells are free if they are known, below `lethal`, and free for the footprint. Moves lead from
    the center of a free cell to 8 or 16 neighbors. A diagonal move needs both cells at its corner,
    and a knight's move (two cells along, one across) needs both cells that it passes between.

    The cost of a move is its length in 3-D [m] times `1 + cost_weight * cost / 252`, where 252 is
    Nav2's highest cost without a collision, and `cost` is the mean along the move: over both cells,
    or over all four cells of a knight's move. Without a `cost` layer, it is the length.

    The graph is a snapshot: later changes of the map have no effect. It needs about 450 bytes per
    cell with 16 neighbors.

    Args:
        grid_map: the map.
        cost: layer of costs, not negative; None for a cost of 0 everywhere.
        cost_weight: extra cost per meter at a cost of 252; 0 finds the shortest path.
        lethal: cells with at least this cost are blocked, 253 for costs of Nav2. None blocks
            infinite costs only.
        elevation: layer of heights [m]; None for flat ground.
        limits: steepest slopes; needs `elevation`. The slope along a move is that between its ends.
            The slope across it is that of the gradient at each end: central differences, or
            one-sided differences beside an unknown cell.
        max_step: largest difference of height between two cells that share a side [m], for all
            cells that a move passes; needs `elevation`.
        footprint: outline of the robot. It must be free in the direction of a move at every cell
            that the move passes. None if the robot fits into a cell.
        neighbors: number of moves from each cell, 8 or 16. On flat ground, costs are at most 8.3 %
            or 2.8 % above the straight distance.
        unknown: `"blocked"` or `"free"`, for cells whose cost is NaN; if free, they cost 0. Cells
            whose elevation is NaN are always blocked.

    Raises:
        LayerNotFoundError: the map has no such layer.
        GeometryError: a number or a cost is out of range.
        ConfigError: `neighbors` or `unknown` has another value, or an argument needs a layer that
            is not given.

    Example:
        >>> grid_map = GridMap((3.0, 3.0), 1.0, layers={"cost": 0.0})
        >>> TravelGraph(grid_map, cost="cost").path((1.0, 1.0), (-1.0, -1.0)).length
        2.8284271247461903
    """

    def __init__(
        self,
        grid_map: GridMap,
        *,
        cost: str | None = None,
        cost_weight: float = 1.0,
        lethal: float | None = None,
        elevation: str | None = None,
        limits: SlopeLimits | None = None,
        max_step: float | None = None,
        footprint: Footprint | None = None,
        neighbors: Literal[8, 16] = 16,
        unknown: Literal["blocked", "free"] = "blocked",
    ) -> None:
        weight = as_finite(cost_weight, "cost_weight", "a number", least=0.0)
        if neighbors not in _MOVES:
            raise ConfigError(f"neighbors: expected 8 or 16, got {short(neighbors)}")
        if unknown not in ("blocked", "free"):
            raise ConfigError(f"unknown: expected 'blocked' or 'free', got {short(unknown)}")
        if not isinstance(limits, SlopeLimits | None):
            raise ConfigError(f"limits: expected SlopeLimits, got {short(limits)}")
        if not isinstance(footprint, Footprint | None):
            raise ConfigError(f"footprint: expected a Footprint, got {short(footprint)}")
        for name, value, needed, layer in (
            ("lethal", lethal, "cost", cost),
            ("limits", limits, "elevation", elevation),
            ("max_step", max_step, "elevation", elevation),
        ):
            if value is not None and layer is None:
                raise ConfigError(f"{name}: expected the argument {needed} as well, got None")
        known, passable, costs = _read_costs(grid_map, cost, lethal, unknown)
        heights, gradient = np.zeros(padded(known, False).size), np.zeros((2, 1))
        if elevation is not None:
            values = grid_map.unwrapped(elevation).astype(np.float64)
            has_height = np.isfinite(values)
            known &= ~np.isnan(values)
            passable &= has_height
            heights = padded(np.where(has_height, values, 0.0), 0.0)
            gradient = _gradient(heights, padded(has_height, False), grid_map)
        self._ground = Ground(
            geometry=grid_map.geometry,
            start_index=grid_map.start_index,
            known=padded(known, False),
            passable=padded(passable, False),
            factor=1.0 + weight / _HIGHEST_COST * padded(costs, 0.0),
            is_flat=elevation is None,
            heights=heights,
            gradient=gradient,
            steepness=_steepness(limits, max_step),
            footprint=footprint,
            outside_is_free=unknown == "free" and elevation is None,
        )
        moves = _MOVES[neighbors]
        free = self._ground.free_at(np.array([math.atan2(-j, -i) for i, j in moves]))
        self._free: Mask = np.logical_or.reduce(free)
        self._matrix = _matrix(self._ground, free, moves)

    def cost_to(self, goals: ArrayLike) -> CostField:
        """Return the least cost from every cell to the nearest of the goals.

        Args:
            goals: (M, 2) x, y [m], or (M, 3) with yaws [rad]; one goal may be (2,) or (3,).

        Raises:
            NoPathError: a goal is outside the map, blocked or unknown.
        """
        poses = np.atleast_2d(as_array(goals, np.float64, "goals"))
        if poses.ndim != 2 or not poses.size:
            raise GeometryError(f"goals: expected shape (M, 2) or (M, 3), got {poses.shape}")
        ends: dict[int, Floats] = {}
        for number, values in enumerate(poses):
            name = "goal" if len(poses) == 1 else f"goal {number}"
            pose = as_pose(values, name)
            cell = free_cell(self._ground, self._free_with(pose), pose, name)
            ends.setdefault(cell, pose)
        return self._field(ends)

    def path(self, start: ArrayLike, goal: ArrayLike, *, tolerance: float = 0.0) -> Path:
        """Return the least-cost path from a start to a goal.

        `CostField.path` returns further paths to the same goal much faster.

        Args:
            start, goal: (2,) x, y [m], or (3,) with the yaw [rad]. A footprint must be free at the
                goal in its yaw.
            tolerance: distance from a goal that is blocked, unknown or out of reach to the end of
                the path [m]. The path leads to the center of the nearest cell within reach.

        Raises:
            NoPathError: the start or goal is outside the map, blocked or unknown, or no path
                connects them.
        """
        tolerance = as_finite(tolerance, "tolerance", "a number", least=0.0)
        begin, end = as_pose(start, "start"), as_pose(goal, "goal")
        first = free_cell(self._ground, self._free, begin, "start")
        free = self._free_with(end)
        candidates = free if tolerance == 0.0 else np.ones_like(free)
        cell = free_cell(self._ground, candidates, end, "goal")
        field = self._field({cell: end}) if free[cell] else None
        if field is None or (tolerance > 0.0 and not field._reaches(first)):
            cell, end = self._nearest_goal(first, free, end, tolerance)
            field = self._field({cell: end})
        return field._path_from(first, begin)

    def _nearest_goal(
        self, start: int, free: Mask, goal: Floats, tolerance: float
    ) -> tuple[int, Floats]:
        """Return the cell in `free` within reach that is nearest to the goal, and its pose."""
        ground = self._ground
        reached = breadth_first_order(self._matrix.T, start, return_predecessors=False)
        cells = reached[free[reached]]
        centers = ground.to_positions(ground.cells(cells))
        distances = np.hypot(*(centers - goal[:2]).T)
        if not distances.min(initial=math.inf) <= tolerance:
            ends = f"{as_text(goal[:2])} or a cell at most {tolerance:g} m away"
            count = f"{len(reached)} of {np.count_nonzero(self._free)} free cells"
            text = f"goal: no path leads to {ends}; {count} can be reached from the start"
            raise NoPathError(text, PathFailure.NO_VALID_PATH)
        nearest = distances.argmin()
        return cells.item(nearest), np.append(centers[nearest], goal[2])

    def _field(self, goals: dict[int, Floats]) -> CostField:
        costs, following, _ = dijkstra(
            self._matrix, indices=list(goals), min_only=True, return_predecessors=True
        )
        return CostField(
            _ground=self._ground, _free=self._free, _costs=costs, _next=following, _goals=goals
        )

    def _free_with(self, pose: Floats) -> Mask:
        """Return the free cells where the footprint is also free in the yaw of a pose, if any."""
        if self._ground.footprint is None or np.isnan(pose[2]):
            return self._free
        free: Mask = self._free & self._ground.free_at(pose[2:])[0]
        return free


def _steepness(limits: SlopeLimits | None, max_step: float | None) -> Steepness:
    step = math.inf if max_step is None else as_finite(max_step, "max_step", least=0.0)
    if limits is None:
        return Steepness(step=step)
    up, down, cross = map(math.tan, (limits.up, limits.down, limits.cross))
    return Steepness(up=up, down=down, cross=cross, step=step)


def _read_costs(
    grid_map: GridMap, layer: str | None, lethal: float | None, unknown: str
) -> tuple[Mask, Mask, Floats]:
    """Return the known cells, the passable cells, and the costs, (rows, cols) in map order.

    Costs of cells that are not passable are 0.
    """
    if layer is None:
        known = np.ones(grid_map.size, np.bool_)
        return known, known.copy(), np.zeros(grid_map.size)
    costs = grid_map.unwrapped(layer).astype(np.float64)
    is_nan = np.isnan(costs)
    costs[is_nan] = 0.0
    if (costs < 0.0).any():
        cell = divmod(int(costs.argmin()), costs.shape[1])
        text = f"cost: expected no negative numbers in layer {layer!r}, got {costs[cell]:g}"
        place = as_text(grid_map.geometry.center_of(cell))
        raise GeometryError(f"{text} at {place}. Set the costs of unknown cells to NaN")
    limit = math.inf if lethal is None else as_number(lethal, "lethal")
    if math.isnan(limit):
        raise GeometryError("lethal: expected a number, got nan")
    known = ~is_nan if unknown == "blocked" else np.ones_like(is_nan)
    passable = known & (costs < limit)
    return known, passable, np.where(passable, costs, 0.0)


def _gradient(heights: Floats, known: Mask, grid_map: GridMap) -> Floats:
    """Return the slopes (2, S) along rows and columns: central or one-sided differences.

    The slope along an axis is 0 where both neighbors are unknown.
    """
    gradient, size = np.zeros((2, heights.size)), heights.size
    for slope, step in zip(gradient, (grid_map.size[1] + 2 * BORDER, 1), strict=True):
        before, inner, after = (
            slice(size - 2 * step),
            slice(step, size - step),
            slice(2 * step, size),
        )
        has_before, has_after = known[before] & known[inner], known[inner] & known[after]
        rise = np.where(has_after, heights[after] - heights[inner], 0.0)
        rise += np.where(has_before, heights[inner] - heights[before], 0.0)
        count = has_before.astype(np.float64) + has_after
        slope[inner] = rise / (np.maximum(count, 1.0) * grid_map.resolution)
    return gradient


def _matrix(ground: Ground, free: Mask, moves: Sequence[Move]) -> Any:
    """Return the sparse matrix of the costs of moves: row b, column a is the cost from a to b.

    Args:
        free: (K, S) cells that the robot can pass in the direction of each of the K moves.
    """
    size = ground.passable.size
    costs = np.full((size, len(moves)), np.inf)
    inner = slice(ground.flat(0, 0), size - ground.flat(0, 0))
    for number, move in enumerate(moves):
        costs[inner, number] = _move_costs(ground, free[number], move)
    exists = np.isfinite(costs)
    offsets = np.array([ground.stride * i + j for i, j in moves])
    begin = (np.arange(size)[:, np.newaxis] - offsets)[exists].astype(np.int32)
    ends = np.append(0, exists.sum(axis=1).cumsum())
    return csr_matrix((costs[exists], begin, ends), shape=(size, size))


def _move_costs(ground: Ground, free: Mask, move: Move) -> Floats:
    """Return the costs of a move to each cell, from the first cell of the map to its last."""
    margin, stride, (i, j) = ground.flat(0, 0), ground.stride, move

    def at(values: Any, cell: Move) -> Any:
        """Return the values of a cell, given relative to the start of the move."""
        offset = stride * (cell[0] - i) + cell[1] - j
        return values[margin + offset : values.size - margin + offset]

    passed = _passed(move)
    cells = ((0, 0), *passed, move)
    exists = np.logical_and.reduce([at(free, cell) for cell in cells])
    run = length = ground.geometry.resolution * math.hypot(i, j)
    if not ground.is_flat:
        rise = at(ground.heights, move) - at(ground.heights, (0, 0))
        exists &= ground.steepness.allows(rise, run) & _is_gentle(ground, move, cells, at)
        length = np.hypot(run, rise)
    weighted = cells if max(abs(i), abs(j)) == 2 else ((0, 0), move)
    mean = sum(at(ground.factor, cell) for cell in weighted) / len(weighted)
    return np.where(exists, length * mean, np.inf)


def _is_gentle(ground: Ground, move: Move, cells: Sequence[Move], at: Any) -> Mask | bool:
    """Return whether the slope across a move and the steps on its cells are allowed."""
    limits, gentle = ground.steepness, True
    if limits.cross < VERTICAL:
        (i, j), (along_rows, along_columns) = move, ground.gradient
        across = np.abs(along_rows * j - along_columns * i) / math.hypot(i, j)
        level = across <= limits.cross + ROUNDING
        gentle = at(level, (0, 0)) & at(level, move)
    if math.isfinite(limits.step):
        for a, b in combinations(cells, 2):
            if abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1:
                step = at(ground.heights, a) - at(ground.heights, b)
                gentle = gentle & (np.abs(step) <= limits.step + ROUNDING)
    return gentle


def _passed(move: Move) -> tuple[Move, ...]:
    """Return the cells between the ends of a move, relative to its start."""
    i, j = move
    if abs(i) + abs(j) == 1:
        return ()
    if abs(i) == abs(j):
        return (i, 0), (0, j)
    return ((i // 2, 0), (i // 2, j)) if abs(i) == 2 else ((0, j // 2), (i, j // 2))
