# SPDX-License-Identifier: BSD-3-Clause
"""Least-cost paths, compared with a slow graph of single cells and with geometry."""

import math
from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.sparse.csgraph import csgraph_from_dense, dijkstra

from grid_map_core_py import ConfigError, GeometryError, GridMap, GridMapError, LayerNotFoundError
from grid_map_core_py.planning import (
    Footprint,
    NoPathError,
    PathFailure,
    SlopeLimits,
    TravelGraph,
    check_path,
    check_pose,
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

    def __init__(self, grid_map, *, neighbors, unknown, cost_weight, **limits):
        self.map, self.weight, self.limits = grid_map.copy(), cost_weight, limits
        self.cost, self.height = (grid_map.unwrapped(n).astype(float) for n in ("cost", "height"))
        if unknown == "free":
            self.cost[np.isnan(self.cost)] = 0.0
        self.free = np.isfinite(self.cost) & (self.cost < limits["lethal"])
        self.height[np.isinf(self.height)] = np.nan
        self.free &= np.isfinite(self.height)
        self.map["free"] = np.roll(self.free, grid_map.start_index, axis=(0, 1))
        reach = {8: 2, 16: 5}[neighbors]
        around = [(i, j) for i, j in np.ndindex(5, 5) if 0 < (i - 2) ** 2 + (j - 2) ** 2 <= reach]
        self.moves = [(i - 2, j - 2) for i, j in around if {i, j} not in ({0, 2}, {2, 4})]
        yaws = [math.atan2(j, i) for i, j in self.moves]
        cells = map(tuple, np.argwhere(self.free).tolist())
        self.nodes = [cell for cell in cells if any(self.fits(cell, yaw) for yaw in yaws)]

    def fits(self, cell, yaw):
        if self.limits["footprint"] is None:
            return True
        pose = (*center(self.map, *cell), yaw)
        return check_pose(self.map, self.limits["footprint"], pose, layer="free", limit=0.5).is_free

    def slope(self, cell, axis):
        step = np.eye(2, dtype=int)[axis]
        places = [tuple(np.add(cell, k * step).tolist()) for k in (-1, 0, 1)]
        inside = [p for p in places if min(p) >= 0 and np.less(p, self.free.shape).all()]
        known = [p for p in inside if np.isfinite(self.height[p])]
        rise = self.height[known[-1]] - self.height[known[0]]
        return rise / (max(len(known) - 1, 1) * self.map.resolution)

    def move(self, a, b):
        """Return the cost of a move; infinite if it is not allowed."""
        extent, slopes = np.subtract(b, a), self.limits["limits"]
        block = product(*(range(min(ends), max(ends) + 1) for ends in zip(a, b, strict=True)))
        passed = [cell for cell in block if touches(a, b, cell)]
        yaw = math.atan2(*-extent[::-1])
        allowed = (
            all(self.free[cell] for cell in passed) and self.fits(a, yaw) and self.fits(b, yaw)
        )
        for one, other in product(passed, passed):
            step = abs(self.height[one] - self.height[other])
            allowed &= sum(abs(np.subtract(one, other))) != 1 or step <= self.limits["max_step"]
        rise, run = self.height[b] - self.height[a], self.map.resolution * math.hypot(*extent)
        allowed &= -slopes.down <= math.atan2(rise, run) <= slopes.up
        for cell in a, b:
            tilt = self.slope(cell, 1) * extent[0] - self.slope(cell, 0) * extent[1]
            allowed &= abs(math.atan(tilt / math.hypot(*extent))) <= slopes.cross
        places = [np.add(a, extent * (k + 0.5) / 8) for k in range(8)]
        mean = np.mean([self.cost[tuple(np.rint(place).astype(int))] for place in places])
        return math.hypot(run, rise) * (1.0 + self.weight * mean / 252.0) if allowed else np.inf

    def costs_to(self, goals):
        """Return the cost from each cell to the nearest goal."""
        size, nodes = self.free.shape, set(self.nodes)
        matrix = np.full((self.free.size,) * 2, np.inf)
        for a in nodes:
            for b in nodes & {(a[0] + i, a[1] + j) for i, j in self.moves}:
                ends = np.ravel_multi_index(np.transpose([b, a]), size)
                matrix[tuple(ends)] = self.move(a, b)
        graph = csgraph_from_dense(matrix, null_value=np.inf)
        numbers = np.ravel_multi_index(np.transpose(goals), size)
        return dijkstra(graph, indices=numbers, min_only=True).reshape(size)


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
        "footprint": [None, None, Footprint.rectangle(0.9, 0.3)][rng.integers(3)],
    }
    return grid_map, options, rng


@pytest.mark.parametrize("seed", range(120))
def test_costs_equal_a_slow_graph(seed):
    grid_map, options, rng = random_map(seed)
    slow = SlowGraph(grid_map, **options)
    if not slow.nodes:
        return
    goals = [slow.nodes[int(k)] for k in rng.integers(len(slow.nodes), size=2)]
    graph = TravelGraph(grid_map, cost="cost", elevation="height", **options)
    field = graph.cost_to([center(grid_map, *goal) for goal in goals])
    assert field.costs.dtype == np.float64
    grid_map["to_go"] = field.costs
    found = np.roll(field.costs, np.negative(grid_map.start_index), axis=(0, 1))
    np.testing.assert_allclose(found, slow.costs_to(goals), rtol=1e-9)


@pytest.mark.parametrize(("neighbors", "excess"), [(8, 0.083), (16, 0.028)])
@pytest.mark.parametrize("degrees", [0, 20])
def test_planes_are_nearly_euclidean(neighbors, excess, degrees):
    slope = math.tan(math.radians(degrees))
    grid_map = a_map(np.zeros((61, 47)), resolution=0.1, start_index=(11, 5))
    x, y = grid_map.axes()
    grid_map["height"] = np.repeat(slope * x[:, None], len(y), axis=1)
    goal = center(grid_map, 30, 23)
    field = TravelGraph(grid_map, elevation="height", neighbors=neighbors).cost_to(goal)
    rise = slope * (x[:, None] - goal[0])
    distances = np.sqrt((x[:, None] - goal[0]) ** 2 + (y - goal[1]) ** 2 + rise**2)
    assert (field.costs >= distances - 1e-5).all()
    assert (field.costs <= (1.0 + excess + slope**2 / 8) * distances + 1e-5).all()
    for cell in (0, 0), (60, 3), (17, 46), (29, 0), (30, 24):
        start = center(grid_map, *cell)
        path, rise = field.path(start), slope * (start - goal)[0]
        assert path.length == pytest.approx(math.hypot(math.dist(start, goal), rise), rel=1e-5)
        assert path.cost == pytest.approx(path.length)
        assert path.heights[[0, -1]] == pytest.approx([slope * start[0], slope * goal[0]], abs=1e-5)


def ramp_path(cross, *, upwards):
    """Return a path over a ramp of 30 degrees between two flat parts; rows go down the ramp."""
    profile = np.clip(0.1 * (40 - np.arange(60)), 0.0, 2.0) * math.tan(math.radians(30))
    heights = np.repeat(profile[:, None], 41, axis=1)
    grid_map = a_map(np.zeros((60, 41)), resolution=0.1, height=heights)
    limits = SlopeLimits(*np.radians((25, 35, cross)))
    ends = center(grid_map, 10, 20), center(grid_map, 50, 20)
    graph = TravelGraph(grid_map, elevation="height", limits=limits)
    return graph.path(*(reversed(ends) if upwards else ends))


@pytest.mark.parametrize("cross", [10, 22, 23, 30, 90])
def test_a_steep_ramp_is_climbed_by_switchbacks(cross):
    down = ramp_path(cross, upwards=False)
    assert np.ptp(down.positions[:, 1]) == pytest.approx(0.0, abs=1e-9)
    if cross < 23:
        with pytest.raises(NoPathError, match="no path"):
            ramp_path(cross, upwards=True)
        return
    up = ramp_path(cross, upwards=True)
    assert 1.10 < up.length / down.length <= 1.22
    rise, run = np.diff(up.heights), np.hypot(*np.diff(up.positions, axis=0).T)
    assert np.arctan2(rise, run).max() <= math.radians(25.01)
    across = np.abs(np.diff(up.positions[:, 1]) / run) * math.tan(math.radians(30))
    on_ramp = (up.heights[1:] > 0.1) & (up.heights[:-1] < 1.05)
    assert np.arctan(across[on_ramp]).max() <= math.radians(cross + 0.01)


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
    start, goal = center(grid_map, 1, 2), center(grid_map, 17, 25)
    fields = [
        TravelGraph(one, cost="cost", elevation="height").cost_to(goal)
        for one in (grid_map, moved_in_buffer(grid_map, start_index))
    ]
    assert np.array_equal(np.roll(fields[0].costs, start_index, (0, 1)), fields[1].costs)
    np.testing.assert_equal(*(vars(field.path(start)) for field in fields))


def test_positions_and_yaws_begin_and_end_at_start_and_goal():
    grid_map = a_map(np.zeros((10, 12)))
    start, goal = center(grid_map, 8, 9) + [0.3, -0.4], center(grid_map, 2, 1) + [-0.2, 0.45]
    graph = TravelGraph(grid_map, cost="cost")
    path, without = graph.path((*start, 1.5), (*goal, -2.5)), graph.path(start, goal)
    assert path.positions[[0, -1]].tolist() == [start.tolist(), goal.tolist()]
    assert path.yaws[[0, -1]].tolist() == [1.5, -2.5]
    np.testing.assert_allclose(without.yaws, math.atan2(*(goal - start)[::-1]))
    np.testing.assert_array_equal(path.yaws[1:-1], without.yaws[1:-1])
    assert path.length == pytest.approx(math.dist(start, goal))
    assert path.cost == graph.path(center(grid_map, 8, 9), goal).cost
    assert np.hypot(*np.diff(path.positions, axis=0).T).max() < 2.3
    assert len(path.heights) == len(path.yaws) == len(path.positions)


def test_start_and_goal_in_one_cell_cost_nothing():
    grid_map = a_map([[7.0]])
    start, goal = center(grid_map, 0, 0) + [0.2, 0.1], center(grid_map, 0, 0)
    graph = TravelGraph(grid_map, cost="cost")
    path = graph.path(start, goal)
    assert path.positions.tolist() == [start.tolist(), goal.tolist()]
    assert (path.cost, path.length) == (0.0, pytest.approx(math.hypot(0.2, 0.1)))
    assert graph.path(goal, goal).length == 0.0


def test_each_cell_leads_to_its_nearest_goal():
    grid_map = a_map(np.zeros((1, 9)))
    goals = center(grid_map, 0, 0) - [0, 0.1], center(grid_map, 0, 0), center(grid_map, 0, 7)
    field = TravelGraph(grid_map, cost="cost").cost_to(goals)
    assert field.costs.tolist() == [[0, 1, 2, 3, 3, 2, 1, 0, 1]]
    for column, goal in (2, 0), (0, 0), (8, 2):
        path = field.path(center(grid_map, 0, column))
        assert path.positions[-1].tolist() == goals[goal].tolist()


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


def test_distance_of_nearest_free_cell_suffices_as_tolerance():
    grid_map = GridMap((4.0, 3.0), 0.1, layers={"cost": 0.0})
    grid_map["cost"][3:8, 13:18] = 254.0
    graph, goal = TravelGraph(grid_map, cost="cost", lethal=253), grid_map.get_position((5, 15))
    with pytest.raises(NoPathError, match=r"nearest free cell .*, 0\.3 m away"):
        graph.path((-1.0, 1.0), goal)
    end = graph.path((-1.0, 1.0), goal, tolerance=0.3).positions[-1]
    assert math.dist(end, goal) == pytest.approx(0.3)


def test_a_footprint_may_leave_the_map_with_free_unknown_cells():
    grid_map = a_map(np.zeros((3, 8)))
    ends = center(grid_map, 0, 0), center(grid_map, 0, 7)
    options = {"cost": "cost", "footprint": Footprint.circle(1.6)}
    assert TravelGraph(grid_map, unknown="free", **options).path(*ends).length == pytest.approx(7.0)
    with pytest.raises(NoPathError, match=r"start: .* footprint touches .* has no free cell"):
        TravelGraph(grid_map, **options).path(*ends)


def test_a_footprint_needs_room_in_its_direction():
    costs = np.full((12, 40), 254.0)
    costs[3:9, 2:38] = 0.0
    grid_map = a_map(costs, resolution=0.1, start_index=(9, 22))
    start, goal = center(grid_map, 5, 9), center(grid_map, 5, 20)
    robot = Footprint.rectangle(1.2, 0.3)
    graph = TravelGraph(grid_map, cost="cost", lethal=253, footprint=robot)
    assert graph.path(start, goal).length == pytest.approx(math.dist(start, goal))
    with pytest.raises(NoPathError, match=r"goal: .* where the footprint touches") as caught:
        graph.path(start, (*goal, 0.0))
    assert caught.value.reason is PathFailure.GOAL_OCCUPIED


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("footprint", [Footprint.circle(0.25), Footprint.rectangle(0.9, 0.5)])
def test_a_footprint_stays_free_along_the_path(footprint, seed):
    rng = np.random.default_rng(seed)
    costs = np.where(rng.random((50, 60)) < 0.004 * (1 + seed % 4), 254.0, 0.0)
    costs[22:28, 27:33] = 0.0
    grid_map = a_map(costs, resolution=0.1, start_index=(20, 3))
    grid_map["traversability"] = grid_map["cost"] == 0.0
    graph = TravelGraph(grid_map, cost="cost", lethal=253, footprint=footprint)
    field, rules = graph.cost_to((3.0, -2.0)), {"layer": "traversability", "limit": 0.5}
    free = np.argwhere(field.costs < np.inf).tolist()
    start = max(free, key=lambda cell: math.dist(grid_map.get_position(cell), (3, -2)))
    path = field.path(grid_map.get_position(start))
    for a, b, yaw in zip(path.positions, path.positions[1:-1], path.yaws[:-1], strict=False):
        piece = [(*a, yaw), (*b, yaw)]
        # A move of the graph need only be free at its ends.
        assert all(check_pose(grid_map, footprint, pose, **rules).is_free for pose in piece)
        cells = (grid_map.geometry.corner - np.stack([a, b])) / 0.1 - 0.5
        if np.abs(cells - np.rint(cells)).max() > 1e-6:
            assert check_path(grid_map, footprint, piece, **rules).is_free


@pytest.mark.parametrize("lethal", [0.3, 0.7, 253.0])
def test_costs_equal_to_lethal_are_blocked(lethal):
    grid_map = a_map([[0.0, lethal, 0.0]])
    field = TravelGraph(grid_map, cost="cost", lethal=lethal).cost_to(center(grid_map, 0, 0))
    assert field.costs.tolist() == [[0.0, np.inf, np.inf]]


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


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"cost": "none"}, "no layer 'none'"),
        ({"elevation": "none"}, "no layer 'none'"),
        ({"cost": "signed"}, "cost: expected no negative numbers in layer 'signed', got -1. Set"),
        ({"cost_weight": -1}, "cost_weight: expected a number >= 0, got -1"),
        ({"cost_weight": np.nan}, "cost_weight: expected a number"),
        ({"cost": "cost", "lethal": np.nan}, "lethal: expected a finite number"),
        ({"lethal": 253}, "'cost': expected a layer, for lethal"),
        ({"max_step": 0.0}, "'elevation': expected a layer, for limits and max_step"),
        ({"elevation": "cost", "max_step": -1}, "max_step: expected .* >= 0"),
        ({"limits": SlopeLimits(1, 1, 1)}, "'elevation': expected a layer, for limits"),
        ({"elevation": "cost", "limits": 0.3}, "'limits': expected SlopeLimits"),
        ({"footprint": 0.3}, "'footprint': expected a Footprint, got 0.3"),
        ({"neighbors": 4}, "'neighbors': expected 8 or 16, got 4"),
        ({"unknown": "lethal"}, "'unknown': expected 'blocked' or 'free'"),
    ],
)
def test_wrong_options_are_named(options, text):
    grid_map = a_map(np.zeros((2, 2)), signed=[[0, 1], [-1, np.nan]])
    with pytest.raises((ConfigError, GeometryError, LayerNotFoundError), match=text):
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
        (lambda _: SlopeLimits(0.1, np.nan, -0.1), "down: expected an angle"),
    ],
)
def test_wrong_arguments_are_named(call, text):
    graph = TravelGraph(a_map(np.zeros((2, 2))), cost="cost")
    with pytest.raises(GeometryError, match=f"^{text}"):
        call(graph)


def test_footprint_is_free_at_goal_itself():
    grid_map = GridMap((4.0, 2.0), 0.1, layers={"cost": 0.0})
    grid_map["cost"][grid_map.axes()[0] > 1.0] = 254.0
    robot = Footprint.rectangle(0.7, 0.3)
    graph = TravelGraph(grid_map, cost="cost", lethal=253.0, footprint=robot)
    goal = (0.699, 0.05, 0.0)  # in a cell whose center is far enough from the wall
    with pytest.raises(NoPathError, match="where the footprint touches a blocked cell"):
        graph.path((-1.0, 0.05), goal)
    assert graph.path((-1.0, 0.05), goal, tolerance=0.1).positions[-1] == pytest.approx(
        (0.65, 0.05)
    )
    assert graph.path((-1.0, 0.05), (0.649, 0.05, 0.0)).positions[-1, 0] == 0.649
