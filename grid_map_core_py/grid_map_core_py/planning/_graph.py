# SPDX-License-Identifier: BSD-3-Clause
"""Graph of the moves between the cells of a map, and least-cost paths."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Integers, Mask, Positions, as_array, as_finite, as_text
from ..errors import GeometryError, GridMapError
from ..map._axis import BORDER_TOLERANCE
from ..map._grid_map import GridMap
from ..plugins import check
from ._footprint import Footprint
from ._ground import BORDER, EQUAL, Floats, Ground, SlopeLimits, divided


class PathFailure(IntEnum):
    """Reasons why there is no path; the values are error codes of Nav2's `ComputePathToPose`."""

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
    """Least-cost path from a start to a goal.

    Attributes:
        positions: (N, 2) x, y [m], map frame; at most 2.3 cells apart.
        heights: (N,) height [m]; 0 if the graph has no elevation.
        yaws: (N,) direction of travel [rad]. The first and the last are the yaws of the start and
            the goal if these are given.
        length: length of the path in 3-D [m].
        cost: cost of the path from the center of its first cell to the center of its last cell.
    """

    positions: Positions
    heights: Floats
    yaws: Floats
    length: float
    cost: float


class TravelGraph:
    """Graph of the moves of a robot between the cells of a map, with the cost of each move.

    Moves lead from the center of a free cell to 8 or 16 neighbors. Diagonal moves and knight's
    moves (two cells along, one across) pass between two other cells. Both of these cells must be
    known and below `lethal`.

    The cost of a move is its length in 3-D [m] times `1 + cost_weight * cost / 252`. Here, `cost`
    is the mean cost of the two cells, or of all four cells of a knight's move. The number 252 is
    the highest cost in Nav2 without a collision. Without a `cost` layer, only the length counts.

    The graph is a snapshot: later changes of the map have no effect. With 16 neighbors, the graph
    needs about 250 bytes of memory per cell. Its creation needs about 400 bytes per cell.

    Args:
        grid_map: the map.
        cost: cost layer, not negative; None for a cost of 0 everywhere.
        cost_weight: extra cost per meter at a cost of 252; 0 finds the shortest path.
        lethal: lowest cost at which a cell is blocked; 253 for costs of Nav2. None blocks only
            infinite costs.
        elevation: layer of heights [m]; None for flat ground.
        limits: steepest slopes; needs `elevation`. The slope along a move is measured between its
            ends. The slope across a move is measured at each end, with central differences of
            height. Beside an unknown cell, the differences are one-sided.
        max_step: largest step in height between two cells that share a side [m]. It applies to all
            cells that a move passes. Needs `elevation`.
        footprint: outline of the robot; None if the robot fits into a cell. At both ends of a move,
            the footprint must be free when the robot faces along the move. For a start, or a goal
            without a yaw, it must be free at the center of the cell, in at least one direction.
        neighbors: number of moves from each cell, 8 or 16. On open, flat ground, costs exceed the
            straight distance by at most 8.3 % with 8 moves, and by at most 2.8 % with 16.
        unknown: whether cells whose cost is NaN are `"blocked"`, or `"free"` at a cost of 0. Cells
            whose elevation is NaN are always blocked.

    Raises:
        LayerNotFoundError: the map has no such layer.
        GeometryError: a number or a cost is out of range.
        ConfigError: an argument is invalid, or needs a layer that is not given.

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
        from scipy.sparse import dia_matrix  # slow to import

        weight = as_finite(cost_weight, "cost_weight", "a number", least=0.0)
        check(neighbors in (8, 16), "neighbors", "8 or 16", neighbors)
        check(unknown in ("blocked", "free"), "unknown", "'blocked' or 'free'", unknown)
        check(isinstance(limits, SlopeLimits | None), "limits", "SlopeLimits", limits)
        check(isinstance(footprint, Footprint | None), "footprint", "a Footprint", footprint)
        check(cost is not None or lethal is None, "cost", "a layer, for lethal", cost)
        needs_heights = limits is not None or max_step is not None
        expected = "a layer, for limits and max_step"
        check(elevation is not None or not needs_heights, "elevation", expected, elevation)

        def padded(layer: str | None) -> Floats:
            values = np.zeros(grid_map.size) if layer is None else grid_map.unwrapped(layer)
            return np.pad(values.astype(np.float64), BORDER, constant_values=np.nan).ravel()

        costs, heights = padded(cost), padded(elevation)
        if (costs < 0.0).any():
            text = f"cost: expected no negative numbers in layer {cost!r}, got {np.nanmin(costs):g}"
            raise GeometryError(f"{text}. Set the costs of unknown cells to NaN")
        known = ~(np.isnan(costs) | np.isnan(heights))
        if unknown == "free":
            known, costs = ~np.isnan(heights), np.nan_to_num(costs, nan=0.0, posinf=np.inf)
        most = math.inf if lethal is None else as_finite(lethal, "lethal")
        # In float32, a cost that was set to the limit is not below it.
        with np.errstate(over="ignore"):
            passable = np.isfinite(heights) & (costs < np.float32(most))
        heights[np.isinf(heights)] = np.nan
        # On flat ground, only the border around the map has no height.
        may_leave = unknown == "free" and elevation is None
        ground = Ground(
            geometry=grid_map.geometry,
            passable=passable,
            open=passable | (np.isnan(heights) & may_leave),
            factor=1.0 + weight / 252.0 * np.where(passable, costs, 0.0),
            is_flat=elevation is None,
            heights=heights,
            limits=limits,
            max_step=math.inf if max_step is None else as_finite(max_step, "max_step", least=0.0),
            footprint=footprint,
        )
        self._ground, self._known, self._start_index = ground, known, grid_map.start_index
        self._free, size = np.zeros_like(passable), passable.size
        moves = [(i, j) for i, j in product(range(-2, 3), repeat=2) if math.gcd(i, j) == 1]
        moves = [move for move in moves if neighbors == 16 or 2 not in map(abs, move)]
        moved = np.zeros((len(moves), size))
        for number, (i, j) in enumerate(moves):
            free = ground.free_at(math.atan2(-j, -i))
            self._free |= free
            moved[number] = ground.move_costs((i, j), free)
        # Row b, column a is the cost of the move from a to b; the others are left out.
        offsets = [-ground.stride * i - j for i, j in moves]
        self._matrix = dia_matrix((moved, offsets), shape=(size, size)).tocsr()

    def cost_to(self, goals: ArrayLike) -> CostField:
        """Return the least cost from every cell to the nearest of the goals.

        Args:
            goals: (M, 2) x, y [m], or (M, 3) with yaws [rad]; (2,) or (3,) for one goal. If a goal
                has a yaw, the footprint must be free at the goal with this yaw.

        Raises:
            NoPathError: a goal is outside the map, blocked or unknown.
        """
        from scipy.sparse.csgraph import dijkstra

        poses = np.atleast_2d(as_array(goals, np.float64, "goals"))
        if poses.ndim != 2 or not poses.size:
            raise GeometryError(f"goals: expected shape (M, 2) or (M, 3), got {poses.shape}")
        ends: dict[int, Floats] = {}
        for number, values in enumerate(poses):
            name = "goal" if len(poses) == 1 else f"goal {number}"
            ends.setdefault(self._cell(values, name), values.copy())
        costs, following, _ = dijkstra(
            self._matrix, indices=list(ends), min_only=True, return_predecessors=True
        )
        lines = costs.reshape(-1, self._ground.stride)[BORDER:-BORDER, BORDER:-BORDER]
        in_buffer = np.roll(lines, self._start_index, axis=(0, 1))
        return CostField(costs=in_buffer, _graph=self, _flat=costs, _next=following, _goals=ends)

    def path(self, start: ArrayLike, goal: ArrayLike, *, tolerance: float = 0.0) -> Path:
        """Return the least-cost path from a start to a goal.

        For several paths to the same goal, `cost_to` with `CostField.path` is much faster.

        Args:
            start, goal: (2,) x, y [m], or (3,) with the yaw [rad]. If the goal has a yaw, the
                footprint must be free at the goal with this yaw.
            tolerance: largest distance from the goal to the end of the path [m]. It is used if the
                goal is not free or cannot be reached. The path then ends at the center of the
                nearest cell that can be reached.

        Raises:
            NoPathError: the start or goal is outside the map, blocked or unknown, or no path
                connects them.
        """
        from scipy.sparse.csgraph import breadth_first_order

        tolerance = as_finite(tolerance, "tolerance", "a number", least=0.0)
        first, pose = self._cell(start, "start"), _as_pose(goal, "goal")
        try:
            return self.cost_to(pose).path(start)
        except NoPathError as error:
            replaced = PathFailure.GOAL_OCCUPIED, PathFailure.NO_VALID_PATH
            if not tolerance or error.reason not in replaced:
                raise
        reached = breadth_first_order(self._matrix.T, first, return_predecessors=False)
        nearest, distance = self._nearest(pose, reached[self._free_in(pose)[reached]])
        if not distance <= tolerance + BORDER_TOLERANCE:
            ends = f"{as_text(pose[:2])} or a cell at most {tolerance:g} m away"
            count = f"{len(reached)} of {np.count_nonzero(self._free)} free cells"
            text = f"goal: no path leads to {ends}; {count} can be reached from the start"
            raise NoPathError(text, PathFailure.NO_VALID_PATH)
        return self.cost_to([*nearest, *pose[2:]]).path(start)

    def _free_in(self, pose: Floats) -> Mask:
        """Return a mask of the free cells; if the pose has a yaw, free for this yaw."""
        return self._free & self._ground.free_at(pose[2]) if len(pose) == 3 else self._free

    def _nearest(self, pose: Floats, cells: Integers) -> tuple[Floats, float]:
        """Return the center (2,) and distance [m] of the nearest candidate; infinite if none."""
        centers = self._ground.to_positions(self._ground.cells(cells))
        centers = np.append(centers, [[np.inf, np.inf]], axis=0)
        distances = np.hypot(*(centers - pose[:2]).T)
        return centers[distances.argmin()], float(distances.min())

    def _cell(self, values: ArrayLike, name: str) -> int:
        """Return the flat index of a start or goal cell; raise `NoPathError` if it is not free."""
        pose, ground = _as_pose(values, name), self._ground
        place, cell = as_text(pose[:2]), ground.geometry.cell_at((pose[0], pose[1]))
        if cell is None:
            expected = f"a position on the map ({ground.geometry.place})"
            raise _wrong_end(name, expected, place, "OUTSIDE_MAP")
        free, index = self._free if name == "start" else self._free_in(pose), ground.flat(*cell)
        has_yaw = name != "start" and len(pose) == 3
        if not free[index] or (has_yaw and ground.blocked_at(pose[np.newaxis])[0]):
            state = "which is blocked" if self._known[index] else "which is unknown"
            if ground.passable[index]:
                state = "where the footprint touches a blocked cell"
            nearest, distance = self._nearest(pose, np.flatnonzero(free))
            hint = f"The nearest free cell is at {as_text(nearest)}, {distance:.3g} m away"
            if math.isinf(distance):
                hint = "The map has no free cell"
            raise _wrong_end(name, "a free cell", f"{place}, {state}. {hint}", "OCCUPIED")
        return int(index)


@dataclass(frozen=True, kw_only=True, eq=False)
class CostField:
    """Least cost from every cell to the nearest goal, as returned by `TravelGraph.cost_to`.

    Attributes:
        costs: (rows, cols) float64 in buffer order; inf where no path leads to a goal. To add a
            layer, write `grid_map["cost_to_go"] = field.costs`.
    """

    costs: Floats
    _graph: TravelGraph = field(repr=False)
    _flat: Floats = field(repr=False)  # (S,) costs
    _next: Integers = field(repr=False)  # (S,) next cell towards the goal; negative at a goal
    _goals: dict[int, Floats] = field(repr=False)  # position or pose of the goal in a cell

    def path(self, start: ArrayLike) -> Path:
        """Return the path from a start to the nearest goal.

        The path follows the least-cost moves between cells. Straight lines then replace parts of
        the path wherever a line is allowed and costs no more.

        Args:
            start: (2,) x, y [m], or (3,) with the yaw [rad].

        Raises:
            NoPathError: the start is outside the map, blocked or unknown, or cannot reach a goal.
        """
        graph, ground = self._graph, self._graph._ground
        cell, pose = graph._cell(start, "start"), _as_pose(start, "start")
        if np.isinf(self._flat[cell]):
            goals = [*self._goals.values()]
            target = as_text(goals[0][:2]) if len(goals) == 1 else f"any of {len(goals)} goals"
            text = f"start: no path leads from {as_text(pose[:2])} to {target}"
            count = np.count_nonzero(np.isfinite(self._flat))
            text += f", only from {count} of {np.count_nonzero(graph._free)} free cells"
            raise NoPathError(text, PathFailure.NO_VALID_PATH)
        cells = [cell]
        while (cell := self._next.item(cell)) >= 0:
            cells.append(cell)
        points, costs = ground.cells(cells).astype(np.float64), self._flat[cells]
        goal = self._goals[cells[-1]]
        ends = ground.to_points(np.stack([pose[:2], goal[:2]]))
        lines = np.stack([costs[:-1] - costs[1:], np.ones(len(cells) - 1)])
        points, lines = ground.shortened(points, lines, np.zeros(len(cells), np.bool_))
        cost = min(float(lines[0].sum()), float(costs[0]))
        if len(cells) == 1:
            points, lines = ends, np.array([[0.0], [1.0]])
        is_off = np.abs(ends - points[:, [0, -1]]).max(axis=0) > EQUAL
        if is_off.any():
            first, last = is_off.astype(int)
            points = np.column_stack([ends[:, :first], points, ends[:, 2 - last :]])
            # A line that is allowed replaces the center of the first or last cell at any cost.
            stubs = np.array([[np.inf], [1.0]]).repeat(2, axis=1)
            lines = np.column_stack([stubs[:, :first], lines, stubs[:, 2 - last :]])
            tested = np.ones(points.shape[1], np.bool_)
            tested[[1, -2]] = False
            points, lines = ground.shortened(points, lines, tested)
        begin, _, _ = divided(points[:, :-1], points[:, 1:], lines[1])
        points = np.append(begin, points[:, -1:], axis=1)
        positions, heights = ground.to_positions(points), ground.heights_at(points)
        positions[0], positions[-1] = pose[:2], goal[:2]
        x, y = np.diff(positions, axis=0).T
        yaws = np.arctan2(y, x)
        # Between the start or goal and the center of its cell, a robot does not turn.
        first, last = np.isinf(lines[0, [0, -1]]).astype(int)
        yaws[0], yaws[-1] = yaws[first], yaws[-1 - last]
        yaws = np.append(yaws, yaws[-1])
        for index, end in (0, pose), (-1, goal):
            yaws[index] = end[2] if len(end) == 3 else yaws[index]
        length = float(np.hypot(np.hypot(x, y), np.diff(heights)).sum())
        return Path(positions=positions, heights=heights, yaws=yaws, length=length, cost=cost)


def _as_pose(values: ArrayLike, name: str) -> Floats:
    pose: Floats = as_array(values, np.float64, name)
    if pose.shape not in ((2,), (3,)):
        expected = "x, y of shape (2,) or x, y, yaw of shape (3,)"
        raise GeometryError(f"{name}: expected {expected}, got {pose.shape}")
    if not np.isfinite(pose).all():
        raise _wrong_end(name, "finite numbers", tuple(pose.tolist()), "OUTSIDE_MAP")
    return pose


def _wrong_end(name: str, expected: str, found: object, failure: str) -> NoPathError:
    reason = PathFailure[f"{'START' if name == 'start' else 'GOAL'}_{failure}"]
    return NoPathError(f"{name}: expected {expected}, got {found}", reason)
