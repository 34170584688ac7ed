# SPDX-License-Identifier: BSD-3-Clause
"""A graph of the moves between cells of a map, and least costs in it."""

from __future__ import annotations

import math
from itertools import combinations, product
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, dijkstra

from .._arrays._checks import Mask, as_array, as_finite, as_text
from ..errors import ConfigError, GeometryError, short
from ..map._grid_map import GridMap
from ._footprint import Footprint
from ._ground import ROUNDING, Floats, Ground, SlopeLimits, padded
from ._paths import CostField, NoPathError, Path, PathFailure, as_pose, free_cell

Move: TypeAlias = tuple[int, int]

_AROUND = tuple(product((-2, -1, 0, 1, 2), repeat=2))
_MOVES: dict[int, tuple[Move, ...]] = {
    8: tuple((i, j) for i, j in _AROUND if max(abs(i), abs(j)) == 1),
    16: tuple((i, j) for i, j in _AROUND if math.gcd(i, j) == 1),
}
"""Rows and columns that a move goes, by the number of neighbors."""

_HIGHEST_COST = 252.0  # highest cost of Nav2 at which the robot is not in collision


class TravelGraph:
    """Moves of a robot between the cells of a map, with their costs.

    Moves lead from the center of a free cell to 8 or 16 neighbors. A diagonal move also needs both
    cells at its corner, and a knight's move (two cells along, one across) both cells that it passes
    between; these must be known and below `lethal`.

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
        footprint: outline of the robot. It must be free in the direction of a move at both ends.
            None if the robot fits into a cell.
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
        for name, value, needed, layer in (
            ("lethal", lethal, "cost", cost),
            ("limits", limits, "elevation", elevation),
            ("max_step", max_step, "elevation", elevation),
        ):
            if value is not None and layer is None:
                raise ConfigError(f"{name}: expected the argument {needed} as well, got None")
        for name, given, kind in (
            ("limits", limits, SlopeLimits),
            ("footprint", footprint, Footprint),
        ):
            if not isinstance(given, kind | None):
                raise ConfigError(f"{name}: expected a {kind.__name__}, got {short(given)}")
        costs = _read_costs(grid_map, cost, unknown)
        passable = costs < (math.inf if lethal is None else as_finite(lethal, "lethal"))
        known, heights, gradient = ~np.isnan(costs), None, np.zeros((2, 1))
        if elevation is not None:
            values = grid_map.unwrapped(elevation).astype(np.float64)
            known &= ~np.isnan(values)
            values[np.isinf(values)] = np.nan
            passable &= ~np.isnan(values)
            heights = padded(np.nan_to_num(values), 0.0)
            gradient = _gradient(values, grid_map.resolution)
        self._ground = Ground(
            geometry=grid_map.geometry,
            start_index=grid_map.start_index,
            known=padded(known, False),
            passable=padded(passable, False),
            factor=1.0 + weight / _HIGHEST_COST * padded(np.where(passable, costs, 0.0), 0.0),
            heights=heights,
            gradient=gradient,
            limits=limits,
            max_step=math.inf if max_step is None else as_finite(max_step, "max_step", least=0.0),
            footprint=footprint,
            outside_is_free=unknown == "free" and elevation is None,
        )
        moves = _MOVES[neighbors]
        free = [self._ground.free_at(math.atan2(-j, -i)) for i, j in moves]
        self._free: Mask = np.logical_or.reduce(free)
        self._matrix = _matrix(self._ground, free, moves)

    def cost_to(self, goals: ArrayLike) -> CostField:
        """Return the least cost from every cell to the nearest of the goals.

        Args:
            goals: (M, 2) x, y [m], or (M, 3) with yaws [rad], in which the footprint must be free;
                one goal may be (2,) or (3,).

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
            ends.setdefault(free_cell(self._ground, self._free_with(pose), pose, name), pose)
        costs, following, _ = dijkstra(
            self._matrix, indices=list(ends), min_only=True, return_predecessors=True
        )
        return CostField(
            _ground=self._ground, _free=self._free, _costs=costs, _next=following, _goals=ends
        )

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
        try:
            return self.cost_to(goal).path(start)
        except NoPathError as error:
            if not tolerance or error.reason is PathFailure.GOAL_OUTSIDE_MAP:
                raise
        return self.cost_to(self._nearest_goal(first, end, tolerance)).path(start)

    def _nearest_goal(self, start: int, goal: Floats, tolerance: float) -> Floats:
        """Return the pose of the cell within reach from a cell that is nearest to the goal."""
        ground, free = self._ground, self._free_with(goal)
        reached = breadth_first_order(self._matrix.T, start, return_predecessors=False)
        centers = ground.to_positions(ground.cells(reached[free[reached]]))
        distances = np.hypot(*(centers - goal[:2]).T)
        if not distances.min(initial=math.inf) <= tolerance:
            ends = f"{as_text(goal[:2])} or a cell at most {tolerance:g} m away"
            count = f"{len(reached)} of {np.count_nonzero(self._free)} free cells"
            text = f"goal: no path leads to {ends}; {count} can be reached from the start"
            raise NoPathError(text, PathFailure.NO_VALID_PATH)
        nearest: Floats = np.append(centers[distances.argmin()], goal[2])
        return nearest[~np.isnan(nearest)]

    def _free_with(self, pose: Floats) -> Mask:
        """Return the free cells where the footprint is also free in the yaw of a pose, if any."""
        return self._free if np.isnan(pose[2]) else self._free & self._ground.free_at(pose[2])


def _read_costs(grid_map: GridMap, layer: str | None, unknown: str) -> Floats:
    """Return the costs (rows, cols) in map order; NaN is unknown and blocked."""
    if layer is None:
        return np.zeros(grid_map.size)
    costs: Floats = grid_map.unwrapped(layer).astype(np.float64)
    if (costs < 0.0).any():
        cell = divmod(int(np.nanargmin(costs)), costs.shape[1])
        text = f"cost: expected no negative numbers in layer {layer!r}, got {costs[cell]:g}"
        place = as_text(grid_map.geometry.center_of(cell))
        raise GeometryError(f"{text} at {place}. Set the costs of unknown cells to NaN")
    if unknown == "free":
        costs[np.isnan(costs)] = 0.0
    return costs


def _gradient(heights: Floats, resolution: float) -> Floats:
    """Return the slopes (2, S) along rows and columns: central or one-sided differences.

    The slope along an axis is 0 where both neighbors are unknown.

    Args:
        heights: (rows, cols) [m]; NaN is unknown.
    """
    gradient = []
    for lines in heights, heights.T:
        steps = np.diff(lines, axis=0, prepend=np.nan, append=np.nan) / resolution
        before, after = steps[:-1], steps[1:]
        before, after = (
            np.where(np.isnan(one), other, one) for one, other in ((before, after), (after, before))
        )
        gradient.append(np.nan_to_num(0.5 * (before + after)))
    return np.stack([padded(gradient[0], 0.0), padded(gradient[1].T, 0.0)])


def _matrix(ground: Ground, free: list[Mask], moves: tuple[Move, ...]) -> Any:
    """Return the sparse matrix of the costs of moves: row b, column a is the cost from a to b.

    Args:
        free: K masks (S,) of the cells that are free in the direction of each of the K moves.
    """
    size, margin = ground.passable.size, ground.flat(0, 0)
    costs = np.full((size, len(moves)), np.inf)
    for number, move in enumerate(moves):
        costs[margin : size - margin, number] = _move_costs(ground, free[number], move)
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
        offset = margin + stride * (cell[0] - i) + cell[1] - j
        return values[offset : values.size - 2 * margin + offset]

    # The cells that touch the middle of the move are those that it passes between.
    beside = product({i // 2, -(-i // 2)}, {j // 2, -(-j // 2)})
    cells = sorted({(0, 0), move, *beside})
    exists = np.logical_and.reduce([at(ground.passable, cell) for cell in cells])
    exists &= at(free, (0, 0)) & at(free, move)
    length: Any = ground.geometry.resolution * math.hypot(i, j)
    if ground.heights is not None:
        rise = at(ground.heights, move) - at(ground.heights, (0, 0))
        if ground.limits is not None:
            slope = (ground.gradient[0] * j - ground.gradient[1] * i) / math.hypot(i, j)
            level = ground.limits._allow_across(slope)
            exists &= ground.limits._allow_along(rise, length) & at(level, (0, 0)) & at(level, move)
        for a, b in combinations(cells, 2):
            if abs(a[0] - b[0]) + abs(a[1] - b[1]) == 1:
                step = at(ground.heights, a) - at(ground.heights, b)
                exists &= np.abs(step) <= ground.max_step + ROUNDING
        length = np.hypot(length, rise)
    weighted = cells if max(abs(i), abs(j)) == 2 else [(0, 0), move]
    mean = sum(at(ground.factor, cell) for cell in weighted) / len(weighted)
    return np.where(exists, length * mean, np.inf)
