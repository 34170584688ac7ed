# SPDX-License-Identifier: BSD-3-Clause
"""Node `path_planner` without optional messages; test/plans.py has the tests with them."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
import pytest
import test_poses
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from test_node_costmap import set_parameters, wait_for_level

from conftest import arguments, call
from grid_map_core_py import GridMap
from grid_map_core_py.planning import TravelGraph
from grid_map_core_py.testing import moved_in_buffer
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, to_message
from grid_map_ros_py._planning import Planner, PlannerSettings
from grid_map_ros_py.testing import Peer, Process, peer, running_node

MODULE = "grid_map_ros_py._executables.path_planner"
START, GOAL = (-1.4, 0.1), (1.4, -0.2)


def ground(wall: float = 0.0, gap: float = 0.0) -> GridMap:
    """Return 40 x 30 cells of 0.1 m, stored as if moved, that rise along x.

    The wall at x = 0 has the cost `wall`, except for a gap of 0.4 m around y = `gap`.
    """
    grid_map = GridMap((4.0, 3.0), 0.1, frame_id="odom", timestamp=10**9)
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    grid_map["elevation"] = 0.1 * x
    is_wall = (abs(x) < 0.16) & (abs(y - gap) > 0.2)
    grid_map["cost"] = np.where(is_wall, wall, 0.0)
    return moved_in_buffer(grid_map, (7, 11))


OPEN, LOW, HIGH = ground(), ground(254.0, -1.0), ground(254.0, 1.0)


def pose(place: tuple[float, float], yaw: float = 0.0, frame_id: str = "odom") -> PoseStamped:
    return test_poses.pose(0, *place, yaw, frame_id=frame_id)


def robot(place: tuple[float, float]) -> PoseWithCovarianceStamped:
    return test_poses.pose(0, *place, kind=PoseWithCovarianceStamped)


def poses_of(path: Path) -> np.ndarray:
    """Return the poses (N, 4): x, y, z and yaw."""
    rows = [(p.position, p.orientation) for p in (one.pose for one in path.poses)]
    values = [(p.x, p.y, p.z, 2.0 * math.atan2(q.z, q.w)) for p, q in rows]
    return np.array(values).reshape(-1, 4)


def graph_of(grid_map: GridMap) -> TravelGraph:
    return TravelGraph(grid_map, cost="cost", elevation="elevation", lethal=253.0)


def expected(grid_map: GridMap, start: tuple = START, goal: tuple = GOAL) -> np.ndarray:
    """Return the positions (N, 2) of the path that the library finds."""
    return graph_of(grid_map).path(start, goal).positions


def passes(path: Path, positions: np.ndarray) -> bool:
    """Return whether the plan consists of the path, with poses in between."""
    xy = poses_of(path)[:, :2]
    gaps = np.hypot(*(positions[:, None] - xy).T).min(axis=0)
    length, other = (np.hypot(*np.diff(line, axis=0).T).sum() for line in (xy, positions))
    return bool(gaps.max() < 1e-6 and abs(length - other) < 1e-6)


@contextmanager
def planner(**parameters: object) -> Iterator[tuple[Process, Peer]]:
    with peer() as other, running_node(MODULE, *arguments(**parameters)) as node:
        other.listen("/plan", Path)
        yield node, other


def ask(other: Peer, grid_map: GridMap) -> None:
    other.publish("/grid_map", to_message(grid_map))
    other.publish("/initial_pose", robot(START))
    other.publish("/goal_pose", pose(GOAL, 1.0))


def test_goal_gives_a_plan_with_heights_that_late_subscribers_get() -> None:
    with planner() as (_, other):
        ask(other, LOW)
        path = other.expect("/plan")
        assert path.header.frame_id == "odom"
        assert passes(path, expected(LOW, START, (*GOAL, 1.0)))
        found = poses_of(path)
        np.testing.assert_allclose(found[[0, -1], :2], [START, GOAL])
        np.testing.assert_allclose(found[:, 2], 0.1 * found[:, 0], atol=1e-3)
        assert np.hypot(*np.diff(found[:, :2], axis=0).T).max() <= 0.23 + 1e-9
        ways = np.diff(found[:, :2], axis=0)
        turns = np.arctan2(ways[:, 1], ways[:, 0]) - found[:-1, 3]
        # The yaw at the start is that of the robot.
        np.testing.assert_allclose(np.cos(turns[1:]), 1.0, atol=1e-6)
        np.testing.assert_allclose(found[[0, -1], 3], [0.0, 1.0], atol=1e-6)
        with peer() as late:
            late.listen("/plan", Path)
            assert late.expect("/plan") == path


def test_plan_is_repeated_only_if_a_map_blocks_it() -> None:
    with planner() as (node, other):
        ask(other, OPEN)
        first = other.expect("/plan")
        assert passes(first, expected(OPEN))
        # The node sends the costs for each map.
        other.listen("/cost_to_go", GridMapMessage)
        other.expect("/cost_to_go")
        # The gap of this wall lies on the plan, and the robot has left its first position.
        grid_map = ground(254.0, float(np.interp(0.0, *poses_of(first)[:, :2].T)))
        grid_map["cost"][grid_map.get_index(START)] = 254.0
        other.publish("/grid_map", to_message(grid_map))
        other.expect("/cost_to_go", 2)
        assert len(other.received["/plan"]) == 1
        other.publish("/grid_map", to_message(HIGH))
        assert passes(other.expect("/plan", 2), expected(HIGH))
        # Without a way, the plan is empty; the next map with a way gives a plan again.
        other.publish("/grid_map", to_message(ground(254.0, 9.0)))
        assert other.expect("/plan", 3).poses == []
        other.listen("/diagnostics", DiagnosticArray, 10)
        assert "no plan: " in wait_for_level(other, DiagnosticStatus.WARN).message
        other.wait_until(lambda: "[path_planner]: no plan: " in node.text, "the reason")
        other.publish("/grid_map", to_message(LOW))
        assert passes(other.expect("/plan", 4), expected(LOW))
        wait_for_level(other, DiagnosticStatus.OK)
        # In another frame, the plan has another meaning.
        moved = LOW.copy()
        moved.frame_id = ""
        other.publish("/grid_map", to_message(moved))
        assert other.expect("/plan", 5).poses == []


def test_goal_waits_for_a_pose_and_a_fresh_map() -> None:
    stale = (
        "no plan: no usable map has come on /grid_map (publishers: 1) in the last 1 s; set stale_"
    )
    with planner(stale_after=1.0) as (node, other):
        other.listen("/diagnostics", DiagnosticArray, 10)

        def wait_for_problem(text: str) -> None:
            reports = other.received["/diagnostics"]
            reports.clear()
            other.wait_until(lambda: reports and text in reports[-1].status[0].message, text)
            assert text in node.text

        other.publish("/goal_pose", pose(GOAL))
        wait_for_problem("no plan: no usable map has come on /grid_map (no publisher")
        other.publish("/grid_map", to_message(OPEN))
        other.wait_until(lambda: "no plan: no pose of the robot" in node.text, "no pose")
        wait_for_problem(stale)
        other.publish("/initial_pose", robot(START))
        wait_for_problem(stale)
        assert other.received["/plan"] == []
        other.publish("/grid_map", to_message(LOW))
        assert passes(other.expect("/plan"), expected(LOW))
        # Nothing is sent for a stale map.
        wait_for_problem(stale)
        other.publish("/goal_pose", pose((1.0, 1.0)))
        wait_for_problem(stale)
        assert len(other.received["/plan"]) == 1


def test_make_plan_starts_at_a_pose_or_at_the_robot() -> None:
    with planner() as (node, other):

        def plan(start: PoseStamped, goal: PoseStamped, tolerance: float = 0.0) -> Path:
            request = {"start": start, "goal": goal, "tolerance": tolerance}
            return call(other, GetPlan, "/make_plan", **request).plan

        assert plan(pose(START), pose(GOAL)).poses == []
        text = "make_plan: no usable map has come on /grid_map (no publisher"
        other.wait_until(lambda: text in node.text, text)
        slashed = LOW.copy()
        slashed.frame_id = "/odom"
        other.publish("/grid_map", to_message(slashed))
        other.wait_until(lambda: plan(pose(START), pose(GOAL)).poses, "a plan")
        assert passes(plan(pose(START), pose(GOAL, frame_id="/odom")), expected(LOW))
        assert plan(PoseStamped(), pose(GOAL)).poses == []
        text = "make_plan: no pose of the robot has come on /initial_pose"
        other.wait_until(lambda: text in node.text, text)
        assert ", and tf2_ros is not installed" in node.text
        other.publish("/initial_pose", robot((0.5, 0.5)))
        other.wait_until(lambda: plan(PoseStamped(), pose(GOAL)).poses, "a plan")
        assert passes(plan(PoseStamped(), pose(GOAL)), expected(LOW, (0.5, 0.5), GOAL))
        assert plan(pose(START), pose((0.0, 0.5))).poses == []
        end = poses_of(plan(pose(START), pose((0.0, 0.5)), 0.4))[-1, :2]
        assert 0.1 < math.dist(end, (0.0, 0.5)) <= 0.4
        assert plan(pose(START, 0.0, "base"), pose(GOAL)).poses == []
        need = "a pose in frame 'base' for a map in frame 'odom' needs the package 'tf2_ros'"
        other.wait_until(lambda: f"make_plan: {need}" in node.text, need)
        assert other.received["/plan"] == []


def test_cost_to_go_is_sent_to_subscribers_only() -> None:
    with planner() as (_, other):
        ask(other, LOW)
        end = poses_of(other.expect("/plan"))[-1, :2]
        other.listen("/cost_to_go", GridMapMessage)
        found = from_message(other.expect("/cost_to_go"))
        costs = LOW.with_layers({"cost_to_go": graph_of(LOW).cost_to([end]).costs})
        np.testing.assert_array_equal(found["cost_to_go"], costs.unwrapped("cost_to_go"))
        assert found.at_position("cost_to_go", end) < 0.1
        assert found.at_position("cost_to_go", (0.0, 1.0)) == np.inf
        assert (found.timestamp, found.frame_id) == (LOW.timestamp, "odom")


def test_parameters_apply_to_the_latched_map_at_once() -> None:
    changed = partial(set_parameters, node="path_planner")
    with planner() as (node, other):
        grid_map = OPEN.with_layers({"other": LOW["cost"]})
        ask(other, grid_map)
        assert passes(other.expect("/plan"), expected(OPEN))
        assert changed(other, cost_layer="other") == []
        assert passes(other.expect("/plan", 2), expected(LOW))
        wrong = {"unknown": "worst", "footprint": "[[0, 0], [1, 1]]", "max_slope_up": 20.0}
        for name, reason in zip(wrong, changed(other, **wrong), strict=True):
            assert reason.startswith(f"parameter {name!r}: expected ")
        # The gap of 0.4 m is too narrow for this robot.
        assert changed(other, robot_radius=0.3) == []
        assert other.expect("/plan", 3).poses == []
        assert changed(other, footprint="[[0.1, 0.1], [-0.1, 0.1], [-0.1, -0.1]]") == []
        assert other.expect("/plan", 4).poses
        assert changed(other, cost_layer="nothing") == []
        text = "dropped a message of /grid_map: no layer 'nothing'; available: "
        other.wait_until(lambda: text in node.text, "the missing layer")


@pytest.mark.parametrize("settings", [{}, {"elevation_layer": ""}, {"max_slope_cross": 0.5}])
def test_plans_on_maps_of_one_cell_and_without_values(settings: dict[str, object]) -> None:
    cell = GridMap((0.1, 0.1), 0.1, layers={"elevation": 0.5, "cost": 0.0})
    planner = Planner(cell, PlannerSettings(**settings))
    positions = planner.graph.path((0.0, 0.0, 0.3), (0.01, 0.0, 0.4)).positions
    np.testing.assert_allclose(positions[[0, -1]], [(0.0, 0.0), (0.01, 0.0)])
    assert not planner.blocked(positions).any()
    assert [planner.blocked(positions[:count]).tolist() for count in (0, 1)] == [[], [False]]
    unknown = cell.with_layers({"cost": np.full((1, 1), np.nan)})
    assert Planner(unknown, PlannerSettings(**settings)).blocked(positions).all()


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("settings", [{}, {"max_slope_cross": 0.6, "max_step": 0.3}])
def test_new_plans_are_free_until_a_cell_is_blocked(seed: int, settings: dict[str, Any]) -> None:
    random = np.random.default_rng(seed)
    grid_map = GridMap((4.0, 3.0), 0.1)
    grid_map["cost"] = np.where(random.random((40, 30)) < 0.2, 254.0, 100.0 * random.random())
    grid_map["elevation"] = 0.1 * random.random((40, 30))
    grid_map = moved_in_buffer(grid_map, (13, 5))
    planner = Planner(grid_map, PlannerSettings(**settings))
    start = grid_map.get_position(np.argwhere(grid_map["cost"] < 254.0)[0])
    goal = next(iter(grid_map.get_positions()[::-1]))
    plan = planner.graph.path(start + 0.03, goal, tolerance=9.0).positions
    assert not planner.blocked(plan).any()
    middle = len(plan) // 2
    grid_map["cost"][grid_map.get_index(plan[middle])] = 254.0
    assert Planner(grid_map, PlannerSettings(**settings)).blocked(plan)[middle]


@pytest.mark.parametrize("seed", [92, 134, 201])  # lines pass cells that are not free at the center
def test_new_plans_of_round_robots_are_free(seed: int) -> None:
    random, settings = np.random.default_rng(seed), PlannerSettings(robot_radius=0.17)
    grid_map = GridMap((6.0, 5.0), 0.1, layers={"elevation": 0.0})
    grid_map["cost"] = np.where(random.random((60, 50)) < 0.02, 254.0, 0.0)
    planner = Planner(grid_map, settings)
    plan = planner.graph.path(*random.uniform(-2.0, 2.0, (2, 2)), tolerance=2.0).positions
    assert not planner.blocked(plan).any()
    grid_map["cost"][grid_map.get_index(plan[len(plan) // 2])] = 254.0
    assert Planner(grid_map, settings).blocked(plan).any()
