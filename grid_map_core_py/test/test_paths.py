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
            if sum(abs(np.subtract(one, other))) == 1:
                if abs(self.height[one] - self.height[other]) > self.max_step:
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
    counts = [len(SlowGraph(grid_map, **options).cells) for grid_map, options, _ in map(random_map, range(120))]
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
    assert path.length == pytest.approx(math.hypot(math.dist(start, goal), slope * abs(start - goal)[0]), rel=1e-5)
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
def test_a_steep_ramp_has_no_way_up_with_a_low_cross_limit(cross):
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
    graph = TravelGraph(grid_map, limits=limits, **{"cost" if layer == "cost" else "elevation": layer})
    path = graph.path(center(grid_map, 3, 0), center(grid_map, 5, 5))
    assert path.length == pytest.approx(7.0)


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
    points = [[Fraction(round(u * 2**20), 2**20) - HALF for u in corner - position] for position in path.positions]
    margin = Fraction(-1, 2**15)  # positions are rounded
    for a, b in pairwise(points):
        near = [cell for cell in np.ndindex(costs.shape) if touches(a, b, cell, margin)]
        assert all(costs[cell] < 270 for cell in near)
        for one, other in product(near, near):
            if sum(abs(np.subtract(one, other))) == 1:
                assert abs(heights[one] - heights[other]) <= step + 1e-5
