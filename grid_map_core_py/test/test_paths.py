# SPDX-License-Identifier: BSD-3-Clause
"""Least-cost paths, compared with a slow graph of single cells and with geometry."""

import heapq
import math
from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from grid_map_core_py import ConfigError, GeometryError, GridMap, GridMapError, LayerNotFoundError
from grid_map_core_py.planning import (
    Footprint,
    NoPathError,
    PathFailure,
    SlopeLimits,
    TravelGraph,
    check_path,
)
from grid_map_core_py.testing import moved_in_buffer

HALF = Fraction(1, 2)
ANY = math.pi / 2


def a_map(costs, *, resolution=1.0, start_index=(0, 0), **layers):
    costs = np.asarray(costs, dtype=float)
    size = np.array(costs.shape) * resolution
    grid_map = GridMap(size, resolution, layers={"cost": costs, **layers}, position=(3.0, -2.0))
    return moved_in_buffer(grid_map, start_index)


def center(grid_map, row, column):
    """Return the center of a cell in map order."""
    return grid_map.geometry.centers((row, column))


# --- A slow graph as a reference ------------------------------------------------------------------


def touches(a, b, cell, margin=0):
    """Return whether the segment from a to b [cells] touches the closed square of a cell."""
    low, high = 0, 1
    for begin, end, middle in zip(a, b, cell, strict=True):
        near, far = middle - HALF - margin, middle + HALF + margin
        if begin == end:
            if not near <= begin <= far:
                return False
            continue
        cuts = sorted(((near - begin) / (end - begin), (far - begin) / (end - begin)))
        low, high = max(low, cuts[0]), min(high, cuts[1])
    return low <= high


class SlowGraph:
    """All moves of a map, found cell by cell."""

    def __init__(self, grid_map, *, neighbors, unknown, cost_weight, lethal, limits, max_step):
        self.cost = grid_map.unwrapped("cost").astype(float)
        self.height = grid_map.unwrapped("height").astype(float)
        self.resolution, self.limits, self.max_step = grid_map.resolution, limits, max_step
        if unknown == "free":
            self.cost[np.isnan(self.cost)] = 0.0
        self.free = np.isfinite(self.cost) & (self.cost < lethal) & np.isfinite(self.height)
        self.weight, self.reach = cost_weight, {8: 2, 16: 5}[neighbors]
        self.cells = [*map(tuple, np.argwhere(self.free).tolist())]

    def known(self, cell):
        inside = all(0 <= i < n for i, n in zip(cell, self.free.shape, strict=True))
        return inside and bool(np.isfinite(self.height[cell]))

    def slope(self, cell, axis):
        ends = []
        for side in (-1, 1):
            other = (cell[0] + side * (axis == 0), cell[1] + side * (axis == 1))
            ends.append((other, side) if self.known(other) else (cell, 0))
        (before, low), (after, high) = ends
        if low == high:
            return 0.0
        return (self.height[after] - self.height[before]) / ((high - low) * self.resolution)

    def move(self, a, b):
        """Return the cost of a move, or None if there is none."""
        extent = np.subtract(b, a)
        if not 0 < extent @ extent <= self.reach or abs(extent).max() > 2:
            return None
        if abs(extent).max() == 2 and abs(extent).min() == 0:
            return None
        corners = [sorted((i, j)) for i, j in zip(a, b, strict=True)]
        block = product(*(range(low, high + 1) for low, high in corners))
        passed = [cell for cell in block if touches(a, b, cell)]
        if not all(self.free[cell] for cell in passed):
            return None
        for one, other in product(passed, passed):
            step = abs(self.height[one] - self.height[other])
            if sum(abs(np.subtract(one, other))) == 1 and step > self.max_step:
                return None
        rise, run = self.height[b] - self.height[a], self.resolution * math.hypot(*extent)
        angle = math.atan2(rise, run)
        if angle > self.limits.up or -angle > self.limits.down:
            return None
        across = np.array([-extent[1], extent[0]]) / math.hypot(*extent)
        for cell in a, b:
            tilt = self.slope(cell, 0) * across[0] + self.slope(cell, 1) * across[1]
            if abs(math.atan(tilt)) > self.limits.cross:
                return None
        places = [np.add(a, extent * (k + 0.5) / 8) for k in range(8)]
        mean = np.mean([self.cost[tuple(np.rint(place).astype(int))] for place in places])
        return math.hypot(run, rise) * (1.0 + self.weight * mean / 252.0)

    def costs_to(self, goals):
        """Return the cost from each cell to the nearest goal (Dijkstra's algorithm)."""
        costs = np.full(self.free.shape, np.inf)
        queue = [(0.0, goal) for goal in goals]
        while queue:
            cost, cell = heapq.heappop(queue)
            if cost < costs[cell]:
                costs[cell] = cost
                for other in self.cells:
                    step = max(abs(cell[0] - other[0]), abs(cell[1] - other[1])) <= 2
                    if step and (move := self.move(other, cell)) is not None:
                        heapq.heappush(queue, (cost + move, other))
        return costs


def random_map(seed):
    """Return a map with costs and heights, holes and infinities, and options for a graph."""
    rng = np.random.default_rng(seed)
    rows, columns = rng.integers(1, 8, 2)
    costs = rng.integers(0, 300, (rows, columns)).astype(float)
    heights = rng.normal(0.0, 0.2, (rows, columns))
    for values, share in (costs, 0.1), (heights, 0.06):
        values[rng.random(values.shape) < share] = np.nan
        values[rng.random(values.shape) < 0.03] = np.inf
    start = int(rng.integers(rows)), int(rng.integers(columns))
    grid_map = a_map(costs, resolution=0.5, height=heights, start_index=start)
    options = {
        "neighbors": int(rng.choice([8, 16])),
        "unknown": str(rng.choice(["blocked", "free"])),
        "cost_weight": float(rng.choice([0.0, 0.7, 5.0])),
        "lethal": float(rng.choice([200.0, 280.0])),
        "limits": SlopeLimits(*rng.choice([0.3, 0.6, ANY], 3)),
        "max_step": float(rng.choice([0.3, 9.0])),
    }
    return grid_map, options, rng


@pytest.mark.parametrize("seed", range(120))
def test_costs_equal_a_slow_graph(seed):
    grid_map, options, rng = random_map(seed)
    slow = SlowGraph(grid_map, **options)
    if not slow.cells:
        return
    goals = [slow.cells[int(k)] for k in rng.integers(len(slow.cells), size=2)]
    graph = TravelGraph(grid_map, cost="cost", elevation="height", **options)
    field = graph.cost_to([center(grid_map, *goal) for goal in goals])
    assert field.costs.dtype == np.float64
    grid_map["to_go"] = field.costs
    found = np.roll(field.costs, np.negative(grid_map.start_index), axis=(0, 1))
    np.testing.assert_allclose(found, slow.costs_to(goals), rtol=1e-9)


def test_random_maps_are_not_all_blocked():
    counts = [
        len(SlowGraph(grid_map, **options).cells)
        for grid_map, options, _ in map(random_map, range(120))
    ]
    assert np.median(counts) > 8


# --- Flat ground ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("neighbors", "excess"), [(8, 0.083), (16, 0.028)])
def test_flat_ground_is_nearly_euclidean(neighbors, excess):
    grid_map = a_map(np.zeros((61, 47)), resolution=0.1, start_index=(11, 5))
    goal = center(grid_map, 30, 23)
    field = TravelGraph(grid_map, cost="cost", neighbors=neighbors).cost_to(goal)
    x, y = grid_map.axes()
    distances = np.hypot(x[:, None] - goal[0], y - goal[1])
    assert (field.costs >= distances - 1e-9).all()
    assert (field.costs <= (1.0 + excess) * distances + 1e-9).all()
    for cell in (0, 0), (60, 3), (17, 46), (29, 0), (30, 24):
        start = center(grid_map, *cell)
        path = field.path(start)
        distance = math.dist(start, goal)
        assert path.length == pytest.approx(distance)
        assert path.cost == pytest.approx(distance)


@pytest.mark.parametrize("end", [(2, 20), (25, 12), (38, 38), (20, 3)])
def test_a_plane_of_20_degrees_is_longer_by_its_cosine(end):
    slope = math.tan(math.radians(20))
    heights = np.repeat(slope * 0.1 * np.arange(41)[:, None], 41, axis=1)
    grid_map = a_map(np.zeros((41, 41)), resolution=0.1, height=heights)
    start, goal = center(grid_map, 20, 20), center(grid_map, *end)
    path = TravelGraph(grid_map, elevation="height").path(start, goal)
    assert path.length == pytest.approx(
        math.hypot(math.dist(start, goal), slope * abs(start - goal)[0]), rel=1e-5
    )
    assert path.heights[[0, -1]] == pytest.approx([slope * 2.0, slope * 0.1 * end[0]])


def test_a_detour_is_taken_from_the_documented_weight_on():
    costs = np.full((31, 42), np.nan)
    costs[15, :] = 252.0  # straight
    costs[0, :] = costs[:16, 0] = costs[:16, -1] = 0.0  # around
    costs[15, [0, -1]] = 0.0
    grid_map = a_map(costs)
    start, goal = center(grid_map, 15, 0), center(grid_map, 15, 41)
    straight, around = (
        TravelGraph(grid_map, cost="cost", cost_weight=weight).path(start, goal).length
        for weight in (0.0, 100.0)
    )
    threshold = around / straight - 1.0
    for factor, length in (0.97, straight), (1.03, around):
        graph = TravelGraph(grid_map, cost="cost", cost_weight=factor * threshold)
        assert graph.path(start, goal).length == pytest.approx(length)


# --- Slopes ---------------------------------------------------------------------------------------


def a_ramp():
    """Return a ramp of 30 degrees between two flat parts; rows go down the ramp."""
    profile = np.clip(0.1 * (40 - np.arange(60)), 0.0, 2.0) * math.tan(math.radians(30))
    return a_map(np.zeros((60, 41)), resolution=0.1, height=np.repeat(profile[:, None], 41, axis=1))


def ramp_path(cross, *, upwards):
    grid_map = a_ramp()
    limits = SlopeLimits(math.radians(25), math.radians(35), math.radians(cross))
    ends = center(grid_map, 10, 20), center(grid_map, 50, 20)
    graph = TravelGraph(grid_map, elevation="height", limits=limits)
    return graph.path(*(reversed(ends) if upwards else ends))


@pytest.mark.parametrize("cross", [10, 22])
def test_low_cross_limit_leaves_no_way_up_a_steep_ramp(cross):
    assert ramp_path(cross, upwards=False).length > 4.0
    with pytest.raises(NoPathError, match="no path") as caught:
        ramp_path(cross, upwards=True)
    assert caught.value.reason is PathFailure.NO_VALID_PATH


@pytest.mark.parametrize("cross", [23, 30, 90])
def test_a_steep_ramp_is_climbed_by_switchbacks(cross):
    down, up = ramp_path(cross, upwards=False), ramp_path(cross, upwards=True)
    assert np.ptp(down.positions[:, 1]) == pytest.approx(0.0, abs=1e-9)
    assert 1.10 < up.length / down.length <= 1.22
    rise, run = np.diff(up.heights), np.hypot(*np.diff(up.positions, axis=0).T)
    assert np.arctan2(rise, run).max() <= math.radians(25.01)
    across = np.abs(np.diff(up.positions[:, 1]) / run) * math.tan(math.radians(30))
    on_ramp = np.minimum(up.heights[1:], up.heights[:-1]) > 0.1
    on_ramp &= np.maximum(up.heights[1:], up.heights[:-1]) < 1.05
    assert on_ramp.sum() > 10
    assert np.arctan(across[on_ramp]).max() <= math.radians(cross + 0.01)


def test_a_shortened_path_keeps_the_cross_limit():
    heights = np.repeat(math.tan(math.radians(20)) * np.arange(30.0)[:, None], 40, axis=1)
    grid_map, ends = a_map(np.zeros((30, 40)), height=heights), ((15, 2), (15, 37))
    start, goal = (center(grid_map, *cell) for cell in ends)
    limits = SlopeLimits(*np.radians((25.0, 25.0, 15.0)))
    path = TravelGraph(grid_map, elevation="height", limits=limits).path(start, goal)
    step = np.diff(path.positions, axis=0)
    across = math.tan(math.radians(20)) * np.abs(step[:, 1]) / np.hypot(*step.T)
    assert np.arctan(across).max() <= math.radians(15.01)


def test_a_limit_in_one_direction_restricts_what_is_in_reach():
    grid_map = a_ramp()
    graph = TravelGraph(grid_map, elevation="height", limits=SlopeLimits(0.1, 1.0, 1.0))
    bottom, top = center(grid_map, 50, 20), center(grid_map, 10, 20)
    assert graph.path(top, bottom).length > 4.0
    path = graph.path(bottom, top, tolerance=4.0)
    assert path.heights.max() == 0.0
    assert path.positions[-1] == pytest.approx(center(grid_map, 40, 20))


def test_blocked_cells_do_not_raise_the_ground_beside_them():
    costs, heights = np.zeros((12, 4)), np.zeros((12, 4))
    costs[:, 2], heights[:, 2] = 254.0, 5.0
    grid_map = a_map(costs, height=heights)
    graph = TravelGraph(grid_map, cost="cost", lethal=253, elevation="height")
    start, goal = center(grid_map, 0, 0), center(grid_map, 11, 1) - [0.0, 0.4]
    path = graph.path(start, goal)
    assert path.heights.max() == 0.0
    assert path.length == pytest.approx(math.dist(start, goal))


def test_max_step_holds_for_all_cells_that_a_move_passes():
    heights = np.zeros((5, 7))
    heights[:, 3:] = 0.3
    grid_map = a_map(np.zeros((5, 7)), height=heights)
    start, goal = center(grid_map, 1, 0), center(grid_map, 3, 6)
    TravelGraph(grid_map, elevation="height", max_step=0.3).path(start, goal)
    with pytest.raises(NoPathError):
        TravelGraph(grid_map, elevation="height", max_step=0.29).path(start, goal)
    grid_map["height"][4, 3] = 0.15
    path = TravelGraph(grid_map, elevation="height", max_step=0.2).path(start, goal)
    assert center(grid_map, 4, 3) == pytest.approx(path.positions[np.argmin(path.positions[:, 0])])
    assert np.abs(np.diff(path.heights)).max() < 0.16


# --- Blocked cells --------------------------------------------------------------------------------


def test_a_path_around_a_wall_is_shortened_to_its_corner():
    costs = np.zeros((41, 60))
    costs[8:, 30] = 254.0
    grid_map = a_map(costs)
    start, goal = center(grid_map, 33, 3), center(grid_map, 25, 55)
    corners = center(grid_map, 7, 29), center(grid_map, 7, 31)
    shortest = math.dist(start, corners[0]) + 2.0 + math.dist(corners[1], goal)
    length = TravelGraph(grid_map, cost="cost", lethal=253).path(start, goal).length
    assert length <= 1.005 * shortest


@pytest.mark.parametrize("seed", range(10))
def test_no_further_waypoint_can_be_dropped(seed):
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random((25, 30)) < 0.08, 254.0, 0.0)
    costs[0, 0] = costs[-1, -1] = 0.0
    grid_map = a_map(costs)
    field = TravelGraph(grid_map, cost="cost", lethal=253).cost_to(center(grid_map, 24, 29))
    path = field.path(center(grid_map, 0, 0))
    turns = np.flatnonzero(np.abs(np.diff(path.yaws)) > 1e-9) + 1
    corners = path.positions[[0, *turns.tolist(), -1]]
    cells = np.rint(grid_map.geometry.corner - 0.5 - corners).astype(int).tolist()
    blocked = np.argwhere(costs > 0).tolist()
    for a, c in zip(cells, cells[2:], strict=False):
        assert any(touches(a, c, cell) for cell in blocked)


def test_a_diagonal_wall_is_not_crossed():
    costs = np.where(np.eye(9) > 0, 254.0, 0.0)
    grid_map = a_map(costs, start_index=(4, 7))
    graph = TravelGraph(grid_map, cost="cost", lethal=253)
    with pytest.raises(NoPathError, match="only from 36 of 72 free cells"):
        graph.path(center(grid_map, 0, 8), center(grid_map, 8, 0))


@pytest.mark.parametrize("layer", ["cost", "height"])
def test_stepping_stones_of_one_cell_are_found(layer):
    stones = np.full((7, 9), np.nan)
    stones[[3, 3, 3, 4, 5, 5, 5, 5], [0, 1, 2, 2, 2, 3, 4, 5]] = 0.0
    grid_map = a_map(np.zeros((7, 9)))
    grid_map[layer] = stones
    limits = SlopeLimits(0.1, 0.1, 0.1) if layer == "height" else None
    graph = TravelGraph(
        grid_map, limits=limits, **{"cost" if layer == "cost" else "elevation": layer}
    )
    path = graph.path(center(grid_map, 3, 0), center(grid_map, 5, 5))
    assert path.length == pytest.approx(7.0)


@pytest.mark.parametrize("corner", [(0, 1), (1, 0), (3, 2)])
def test_no_corner_is_cut(corner):
    costs = np.zeros((5, 5))
    costs[corner] = 254.0
    grid_map = a_map(costs)
    ends = center(grid_map, 0, 0), center(grid_map, 4, 4)
    field = TravelGraph(grid_map, cost="cost", lethal=253).cost_to(ends[1])
    assert field.path(ends[0]).length > math.dist(*ends) + 0.1


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_shortened_lines_avoid_blocked_cells(seed):
    """Every piece of a path is tested against every cell, in exact arithmetic."""
    rng = np.random.default_rng(seed)
    rows, columns = (int(n) for n in rng.integers(5, 15, 2))
    costs = rng.integers(0, 300, (rows, columns)).astype(float)
    costs[rng.random(costs.shape) < 0.25] = np.nan
    heights = rng.normal(0.0, 0.1, costs.shape)
    start_index = int(rng.integers(rows)), int(rng.integers(columns))
    grid_map = a_map(costs, height=heights, start_index=start_index)
    step = float(rng.choice([0.2, 9.0]))
    graph = TravelGraph(grid_map, cost="cost", lethal=270, elevation="height", max_step=step)
    known = np.argwhere(costs < 270).tolist()
    if not known:
        return
    start, goal = (known[int(k)] for k in rng.integers(len(known), size=2))
    field = graph.cost_to(center(grid_map, *goal))
    offset = rng.uniform(-0.5, 0.5, 2) * rng.integers(2)
    begin = center(grid_map, *start) + offset
    if not np.isfinite(field.costs[grid_map.get_index(begin)]):
        return
    path = field.path(begin)
    assert path.positions[0].tolist() == begin.tolist()
    assert path.positions[-1].tolist() == center(grid_map, *goal).tolist()
    assert path.cost <= field.costs[grid_map.get_index(begin)]
    corner = grid_map.geometry.corner
    points = [
        [Fraction(round(u * 2**20), 2**20) - HALF for u in corner - position]
        for position in path.positions
    ]
    margin = Fraction(-1, 2**15)  # positions are rounded
    for a, b in pairwise(points):
        near = [cell for cell in np.ndindex(costs.shape) if touches(a, b, cell, margin)]
        assert all(costs[cell] < 270 for cell in near)
        for one, other in product(near, near):
            if sum(abs(np.subtract(one, other))) == 1:
                assert abs(heights[one] - heights[other]) <= step + 1e-5


def test_the_cost_is_the_integral_along_the_positions():
    rng = np.random.default_rng(5)
    costs = np.kron(rng.integers(0, 250, (6, 8)), np.ones((5, 5)))
    heights = np.add.outer(np.sin(np.arange(30) / 5), np.cos(np.arange(40) / 7))
    grid_map = a_map(costs, resolution=0.2, height=heights, start_index=(7, 33))
    graph = TravelGraph(grid_map, cost="cost", cost_weight=3.0, elevation="height")
    for start, goal in ((2, 3), (28, 35)), ((15, 39), (29, 0)), ((0, 20), (29, 21)):
        path = graph.path(center(grid_map, *start), center(grid_map, *goal))
        total = length = 0.0
        for number, (a, b) in enumerate(pairwise(path.positions)):
            shares = ((np.arange(2000) + 0.5) / 2000)[:, None]
            mean = grid_map.at_position("cost", (1.0 - shares) * a + shares * b).mean()
            piece = math.hypot(math.dist(a, b), path.heights[number + 1] - path.heights[number])
            length += piece
            total += piece * (1.0 + 3.0 * mean / 252.0)
        assert path.cost == pytest.approx(total, rel=1e-4)
        assert path.length == pytest.approx(length)
        linear = grid_map.at_position("height", path.positions, "linear")
        np.testing.assert_allclose(path.heights, linear, atol=1e-6)


@pytest.mark.parametrize("start_index", [(0, 0), (3, 8)])
def test_equal_maps_give_equal_bits(start_index):
    rng = np.random.default_rng(8)
    costs = rng.uniform(0, 250, (20, 30))
    grid_map = a_map(costs, height=rng.normal(0, 0.2, costs.shape))
    moved = moved_in_buffer(grid_map, start_index)
    ends = center(grid_map, 1, 2), center(grid_map, 17, 25)
    fields = [
        TravelGraph(one, cost="cost", elevation="height").cost_to(ends[1])
        for one in (grid_map, moved)
    ]
    paths = [field.path(ends[0]) for field in fields]
    moved["to_go"] = np.zeros(costs.shape)
    assert np.array_equal(np.roll(fields[0].costs, start_index, (0, 1)), fields[1].costs)
    for name in "positions", "heights", "yaws":
        assert np.array_equal(getattr(paths[0], name), getattr(paths[1], name))
    assert (paths[0].cost, paths[0].length) == (paths[1].cost, paths[1].length)


# --- Ends -----------------------------------------------------------------------------------------


def test_positions_and_yaws_begin_and_end_at_start_and_goal():
    grid_map = a_map(np.zeros((10, 12)))
    start, goal = center(grid_map, 8, 9) + [0.3, -0.4], center(grid_map, 2, 1) + [-0.2, 0.45]
    graph = TravelGraph(grid_map, cost="cost")
    path = graph.path((*start, 1.5), (*goal, -2.5))
    assert path.positions[0].tolist() == start.tolist()
    assert path.positions[-1].tolist() == goal.tolist()
    assert (path.yaws[0], path.yaws[-1]) == (1.5, -2.5)
    direction = math.atan2(*(goal - start)[::-1])
    np.testing.assert_allclose(path.yaws[1:-1], direction)
    assert path.length == pytest.approx(math.dist(start, goal))
    assert path.cost == graph.path(center(grid_map, 8, 9), goal).cost
    np.testing.assert_allclose(graph.path(start, goal).yaws, direction)
    assert np.hypot(*np.diff(path.positions, axis=0).T).max() < 2.3
    assert len(path.heights) == len(path.yaws) == len(path.positions)


def test_a_start_behind_a_corner_leads_by_its_cell_center():
    costs = np.zeros((3, 3))
    costs[0, 1] = 254.0
    grid_map = a_map(costs)
    start = center(grid_map, 0, 0) + [0.45, -0.45]  # beside the blocked cell
    path = TravelGraph(grid_map, cost="cost", lethal=253).path(start, center(grid_map, 2, 1))
    assert path.positions[1] == pytest.approx(center(grid_map, 0, 0))
    assert path.yaws[0] == path.yaws[1]


def test_start_and_goal_in_one_cell_cost_nothing():
    grid_map = a_map([[7.0]])
    graph = TravelGraph(grid_map, cost="cost")
    start, goal = center(grid_map, 0, 0) + [0.2, 0.1], center(grid_map, 0, 0)
    path = graph.path(start, goal)
    assert path.positions.tolist() == [start.tolist(), goal.tolist()]
    assert (path.cost, path.length) == (0.0, pytest.approx(math.hypot(0.2, 0.1)))
    assert graph.path(goal, goal).length == 0.0


def test_each_cell_leads_to_its_nearest_goal():
    grid_map = a_map(np.zeros((1, 9)))
    goals = np.stack([center(grid_map, 0, 0), center(grid_map, 0, 7)])
    field = TravelGraph(grid_map, cost="cost").cost_to(goals)
    assert field.costs.tolist() == [[0, 1, 2, 3, 3, 2, 1, 0, 1]]
    assert field.path(center(grid_map, 0, 2)).positions[-1].tolist() == goals[0].tolist()
    assert field.path(center(grid_map, 0, 8)).positions[-1].tolist() == goals[1].tolist()
    field = TravelGraph(grid_map, cost="cost").cost_to([goals[0] + 0.1, goals[0]])
    assert field.path(goals[1]).positions[-1].tolist() == (goals[0] + 0.1).tolist()


def test_the_graph_is_a_snapshot():
    grid_map = a_map(np.zeros((3, 5)))
    ends = center(grid_map, 1, 0), center(grid_map, 1, 4)
    graph = TravelGraph(grid_map, cost="cost")
    grid_map["cost"][:, 2] = np.nan
    grid_map.move((9.0, 9.0))
    assert graph.path(*ends).length == pytest.approx(4.0)


def test_a_tolerance_leads_to_the_nearest_cell_within_reach():
    costs = np.zeros((5, 12))
    costs[:, 8], costs[2, 10] = 254.0, np.nan
    grid_map = a_map(costs)
    graph = TravelGraph(grid_map, cost="cost", lethal=253)
    start = center(grid_map, 2, 1)
    for column in 8, 9, 10:  # blocked, out of reach, unknown
        goal = center(grid_map, 2, column)
        with pytest.raises(NoPathError):
            graph.path(start, goal, tolerance=column - 7.5)
        path = graph.path(start, (*goal, 0.5), tolerance=column - 7.0)
        assert path.positions[-1] == pytest.approx(center(grid_map, 2, 7))
        assert path.yaws[-1] == 0.5
    goal = center(grid_map, 2, 6) + 0.25
    assert graph.path(start, goal, tolerance=9.0).positions[-1].tolist() == goal.tolist()
    with pytest.raises(NoPathError) as caught:
        graph.path(start, center(grid_map, 2, 10) + [0, -9], tolerance=50.0)
    assert caught.value.reason is PathFailure.GOAL_OUTSIDE_MAP


def test_unknown_cells_are_free_on_request():
    costs = np.full((3, 5), np.nan)
    costs[0, 0], costs[1, 2] = 0.0, np.inf
    grid_map = a_map(costs, height=np.zeros((3, 5)))
    grid_map["height"][2, 2] = np.nan
    ends = center(grid_map, 2, 0), center(grid_map, 2, 4)
    graph = TravelGraph(grid_map, cost="cost", unknown="free")
    assert graph.path(*ends).cost == pytest.approx(4.0)
    graph = TravelGraph(grid_map, cost="cost", elevation="height", unknown="free")
    path = graph.path(*ends)
    assert path.positions[:, 0].max() > grid_map.geometry.corner[0] - 1.5
    with pytest.raises(NoPathError, match="which is unknown"):
        graph.path(ends[0], center(grid_map, 2, 2))


def test_a_footprint_may_leave_the_map_with_free_unknown_cells():
    grid_map = a_map(np.zeros((3, 8)))
    ends = center(grid_map, 0, 0), center(grid_map, 0, 7)
    options = {"cost": "cost", "footprint": Footprint.circle(0.8)}
    assert TravelGraph(grid_map, unknown="free", **options).path(*ends).length == pytest.approx(7.0)
    with pytest.raises(NoPathError, match="the footprint touches"):
        TravelGraph(grid_map, **options).path(*ends)


# --- Footprints -----------------------------------------------------------------------------------


def test_a_footprint_needs_room_in_its_direction():
    costs = np.full((30, 40), 254.0)
    costs[5:12, 2:38] = costs[5:28, 30:37] = 0.0  # two corridors of 0.7 m
    grid_map = a_map(costs, resolution=0.1, start_index=(9, 22))
    ends = center(grid_map, 8, 9), center(grid_map, 20, 33)
    options = {"cost": "cost", "lethal": 253}
    assert TravelGraph(grid_map, **options).path(*ends)
    graph = TravelGraph(grid_map, **options, footprint=Footprint.circle(0.2))
    path = graph.path(*ends)
    shape = math.dist(*ends)
    assert shape < path.length < 1.6 * shape
    with pytest.raises(NoPathError, match=r"start: expected a free cell.*the footprint touches"):
        TravelGraph(grid_map, **options, footprint=Footprint.circle(0.4)).path(*ends)
    long = TravelGraph(grid_map, **options, footprint=Footprint.rectangle(1.2, 0.3))
    assert long.path(ends[0], center(grid_map, 8, 20)).length == pytest.approx(1.1)
    with pytest.raises(NoPathError, match="no path"):  # it cannot turn into the other corridor
        long.path(*ends)
    with pytest.raises(NoPathError, match="goal: expected a free cell") as caught:
        long.path(ends[0], (*center(grid_map, 8, 20), 0.0))
    assert caught.value.reason is PathFailure.GOAL_OCCUPIED


def test_a_footprint_goes_straight_where_it_fits():
    costs = np.full((40, 13), 254.0)
    costs[:, 1:-1] = 0.0
    grid_map = a_map(costs, resolution=0.1)
    robot = Footprint.rectangle(0.9, 0.3)
    graph = TravelGraph(grid_map, cost="cost", lethal=253, footprint=robot, unknown="free")
    ends = center(grid_map, 2, 5), center(grid_map, 37, 7)
    assert graph.path(*ends).length == pytest.approx(math.dist(*ends))


def test_a_footprint_keeps_its_distance_between_cell_centers():
    costs = np.zeros((60, 20))
    costs[22, 14] = 254.0
    grid_map = a_map(costs, resolution=0.1, free=1.0)
    grid_map["free"][22, 14] = 0.0
    robot = Footprint.circle(0.33)
    graph = TravelGraph(grid_map, cost="cost", lethal=253, footprint=robot)
    path = graph.path(center(grid_map, 5, 10), center(grid_map, 55, 11))
    poses = np.column_stack([path.positions, path.yaws])
    assert check_path(grid_map, robot, poses, layer="free", limit=0.5).is_free


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("shape", ["circle", "rectangle"])
def test_a_footprint_stays_free_along_the_path(shape, seed):
    """Points all over the footprint are on free cells, and `check_path` agrees."""
    x, y = np.meshgrid(np.linspace(-0.425, 0.425, 86), np.linspace(-0.225, 0.225, 46))
    inside, footprint = np.stack([x.ravel(), y.ravel()]), Footprint.rectangle(0.9, 0.5)
    if shape == "circle":
        inside, footprint = inside[:, np.hypot(*inside) < 0.225], Footprint.circle(0.25)
    rng = np.random.default_rng(seed)
    density = 0.004 * (1 + seed % 4)
    costs = np.where(rng.random((50, 60)) < density, 254.0, 0.0)
    costs[22:28, 27:33] = 0.0
    grid_map = a_map(costs, resolution=0.1, start_index=(20, 3))
    graph = TravelGraph(grid_map, cost="cost", lethal=253, footprint=footprint)
    free = np.argwhere(graph.cost_to((3.0, -2.0)).costs < np.inf)
    start = max(free.tolist(), key=lambda cell: math.dist(grid_map.get_position(cell), (3, -2)))
    path = graph.path(grid_map.get_position(start), (3.0, -2.0))
    for position, yaw in zip(path.positions[1:-1], path.yaws[1:-1], strict=True):
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        assert grid_map.at_position("cost", position + (turn @ inside).T).max() == 0.0
    grid_map["traversability"] = grid_map["cost"] == 0.0
    for a, b, yaw in zip(path.positions, path.positions[1:-1], path.yaws[:-1], strict=False):
        piece = [(*a, yaw), (*b, yaw)]
        assert check_path(grid_map, footprint, piece, layer="traversability", limit=0.5).is_free


# --- Errors ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def walled():
    costs = np.zeros((4, 9))
    costs[:, 5], costs[0, 0], costs[3, 0] = 254.0, np.nan, np.inf
    return a_map(costs, start_index=(1, 1))


@pytest.mark.parametrize(
    ("cell", "text", "kind"),
    [
        ((0, -3), r"expected a position on the map \(center .*\), got \(4.5, 5.0\)", "OUTSIDE_MAP"),
        ((0, 0), r"got \(4.5, 2.0\), which is unknown. The nearest free cell is at ", "OCCUPIED"),
        ((2, 5), r"which is blocked. The nearest free cell is at \(2.5, -2.0\), 1 m", "OCCUPIED"),
        ((3, 0), r"which is blocked. The nearest", "OCCUPIED"),
        ((np.nan, 0), r"expected finite numbers, got \(nan, ", "OUTSIDE_MAP"),
        ((0, -np.inf), r"expected finite numbers, got \(4.5, inf\)", "OUTSIDE_MAP"),
    ],
)
def test_errors_name_end_cause_and_nearest_free_cell(walled, cell, text, kind):
    position = walled.geometry.corner - 0.5 - np.array(cell)
    good, graph = center(walled, 1, 1), TravelGraph(walled, cost="cost", lethal=253)
    for name, ends in ("start", (position, good)), ("goal", (good, position)):
        with pytest.raises(
            NoPathError, match=f"^{name}: {text}" if text[0] == "e" else text
        ) as caught:
            graph.path(*ends)
        assert str(caught.value).startswith(f"{name}: ")
        assert caught.value.reason is PathFailure[f"{name.upper()}_{kind}"]
        assert isinstance(caught.value, GridMapError | ValueError)
    with pytest.raises(NoPathError, match="goal 1: "):
        graph.cost_to([good, position])
    with pytest.raises(NoPathError, match="start: "):
        graph.cost_to(good).path(position)


def test_errors_tell_how_many_cells_are_connected(walled):
    graph = TravelGraph(walled, cost="cost", lethal=253)
    ends = center(walled, 1, 1), center(walled, 1, 7)
    with pytest.raises(NoPathError, match=r"start: no path .* only from 12 of 30 free cells"):
        graph.path(*ends)
    with pytest.raises(NoPathError, match=r"at most 1 m away; 18 of 30 free cells can be"):
        graph.path(*ends, tolerance=1.0)
    with pytest.raises(NoPathError, match="any of 2 goals") as caught:
        graph.cost_to([center(walled, 1, 7), center(walled, 1, 8)]).path(ends[0])
    assert caught.value.reason == 208


def test_a_map_without_a_free_cell_says_so():
    grid_map = a_map(np.full((3, 2), np.nan))
    with pytest.raises(NoPathError, match="The map has no free cell"):
        TravelGraph(grid_map, cost="cost").cost_to(center(grid_map, 1, 1))


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"cost": "none"}, LayerNotFoundError, "no layer 'none'"),
        ({"elevation": "none"}, LayerNotFoundError, "no layer 'none'"),
        ({"cost": "signed"}, GeometryError, "cost: expected no negative numbers .* got -1 at "),
        ({"cost_weight": -1}, GeometryError, "cost_weight: expected a number >= 0, got -1"),
        ({"cost_weight": np.nan}, GeometryError, "cost_weight: expected a number"),
        ({"cost": "cost", "lethal": np.nan}, GeometryError, "lethal: expected a number, got nan"),
        ({"lethal": 253}, ConfigError, "lethal: expected the argument cost as well"),
        ({"max_step": 1.0}, ConfigError, "max_step: expected the argument elevation as well"),
        ({"elevation": "cost", "max_step": -1}, GeometryError, "max_step: expected .* >= 0"),
        ({"limits": SlopeLimits(1, 1, 1)}, ConfigError, "limits: expected the argument elev"),
        ({"elevation": "cost", "limits": 0.3}, ConfigError, "limits: expected SlopeLimits"),
        ({"footprint": 0.3}, ConfigError, "footprint: expected a Footprint, got 0.3"),
        ({"neighbors": 4}, ConfigError, "neighbors: expected 8 or 16, got 4"),
        ({"unknown": "lethal"}, ConfigError, "unknown: expected 'blocked' or 'free'"),
    ],
)
def test_wrong_options_are_named(options, error, text):
    grid_map = a_map(np.zeros((2, 2)), signed=[[0, 1], [-1, np.nan]])
    with pytest.raises(error, match=f"^{text}"):
        TravelGraph(grid_map, **options)


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda graph: graph.path((0, 0, 0, 0), (0, 0)), "start: expected x, y of shape"),
        (lambda graph: graph.path((3, -2), [[3, -2]]), "goal: expected x, y of shape"),
        (lambda graph: graph.path((3, -2), (3, -2), tolerance=-1), "tolerance: expected a number"),
        (lambda graph: graph.cost_to([]), "goals: expected shape"),
        (lambda graph: graph.cost_to(np.zeros((1, 2, 2))), "goals: expected shape"),
        (lambda graph: graph.cost_to("here"), "goals: expected numbers"),
        (lambda _: SlopeLimits(25.0, 0.1, 0.1), "up: expected an angle .* Convert degrees"),
        (lambda _: SlopeLimits(0.1, np.nan, 0.1), "down: expected an angle"),
        (lambda _: SlopeLimits(0.1, 0.1, -0.1), "cross: expected an angle"),
    ],
)
def test_wrong_arguments_are_named(call, text):
    graph = TravelGraph(a_map(np.zeros((2, 2))), cost="cost")
    with pytest.raises(GeometryError, match=f"^{text}"):
        call(graph)
