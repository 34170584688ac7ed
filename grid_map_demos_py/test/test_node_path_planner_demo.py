# SPDX-License-Identifier: BSD-3-Clause
"""The path planner demo: the walking robot, and all nodes together."""

import math
import re
import sys

import numpy as np
import pytest
import yaml
from demos import PACKAGE
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path

from grid_map_core_py import GridMap, line_cells
from grid_map_core_py.conversions import change_resolution
from grid_map_demos_py.report_node import draw_walk
from grid_map_demos_py.robot_course import (
    ARRIVED,
    GOAL,
    MAX_RANGE,
    START,
    STRIDE,
    Walker,
    load_cliff,
)
from grid_map_filters_py import FilterChain
from grid_map_ros_py import from_pose, to_message
from grid_map_ros_py.testing import Process, peer, running_node


def test_walker_follows_the_latest_plan_at_its_speed():
    walker = Walker()
    walker.walk(0.5)
    assert (*walker.position,) == START
    np.testing.assert_allclose(math.dist(START, GOAL) * walker.way, np.subtract(GOAL, START))
    walker.position = np.zeros(2)
    plan = np.array([[0.0, 0.0], [0.3, 0.4], [0.3, 1.4]])
    walker.follow(plan)
    way = [walker.position]
    for _ in range(5):
        walker.walk(0.2)
        way.append(walker.position)
    np.testing.assert_allclose(way[-1], (0.3, 0.9))
    np.testing.assert_allclose(walker.way, (0.0, 1.0))
    # The corner is cut by at most one step.
    np.testing.assert_allclose(np.hypot(*np.diff(way, axis=0).T), 0.2, atol=0.04)
    # It goes on from the nearest point of another plan, and stops without one.
    walker.follow(np.array([[0.0, 0.0], [0.3, 0.9], [1.3, 0.9]]))
    walker.walk(0.4)
    np.testing.assert_allclose(walker.position, (0.7, 0.9))
    walker.follow(np.empty((0, 2)))
    walker.walk(0.4)
    np.testing.assert_allclose(walker.position, (0.7, 0.9))
    walker.follow(plan)
    walker.walk(100.0)
    np.testing.assert_allclose(walker.position, plan[-1])


def test_only_a_cliff_out_of_sight_blocks_the_straight_line():
    ground = load_cliff(PACKAGE / "data" / "jacksboro_fault_dem.npz")
    file = (PACKAGE / "config" / "path_planner_demo_mapping.yaml").read_text()
    pipeline = yaml.safe_load(file)["elevation_mapping"]["ros__parameters"]
    chain = FilterChain.from_config([*pipeline["postprocessor_pipeline"].values()])
    # Without the walls at the borders.
    costs = chain(change_resolution(ground, 0.1)).get_submap((0.0, 0.0), (18.5, 15.5))
    blocked = costs["cost"] >= 253
    cliff = costs.get_positions(np.nonzero(blocked))
    assert np.hypot(*(cliff - (4.6, 3.7)).T).max() < 3.0
    assert np.hypot(*(cliff - START).T).min() > MAX_RANGE
    # Slopes and steps of the terrain are far from those that block cells.
    is_cliff = np.hypot(*(costs.get_positions() - (4.6, 3.7)).T) < 3.4
    assert costs["cost"].ravel("F")[~is_cliff].max() < 150
    assert costs["step_height"].ravel("F")[~is_cliff].max() < 0.35
    assert blocked[line_cells(costs, START, GOAL)].any()


def test_picture_shows_all_plans_and_the_walk():
    truth = GridMap((12.0, 12.0), 1.0, layers={"elevation": 0.0, "inflated_cost": 0.0})
    truth["elevation"][2, 3] = truth["inflated_cost"][3, 2] = 1.0
    plans = [np.array([START, GOAL]), np.array([START, (0.0, 0.0), GOAL])]
    walk = np.array([START, (1.0, 1.0), GOAL])
    for ax in draw_walk(truth, truth, plans, walk).axes[:2]:
        drawn = [line.get_xydata().tolist() for line in ax.lines]
        assert all(line.tolist() in drawn for line in (*plans, walk))


def test_robot_repeats_its_goal_and_waits_for_maps():
    plan = Path()
    for x, y in (START, GOAL):
        plan.poses.append(PoseStamped())
        plan.poses[-1].pose.position.x, plan.poses[-1].pose.position.y = x, y
    grid_map = to_message(GridMap((1.0, 1.0), 0.5, layers={"elevation": 0.0}))
    with peer() as other, running_node("grid_map_demos_py.path_planner_robot_node"):
        other.listen("/initial_pose", PoseWithCovarianceStamped)
        other.listen("/goal_pose", PoseStamped)
        poses, goals = other.received["/initial_pose"], other.received["/goal_pose"]

        def walked() -> float:
            return math.dist(from_pose(poses[-1])[:2, 3], START) if poses else 0.0

        for number in (1, 2):
            other.publish("/elevation_mapping/elevation_map", grid_map)
            goal = other.expect("/goal_pose", number).pose.position
            assert (goal.x, goal.y) == GOAL
        assert walked() == 0.0
        other.publish("/plan", plan)
        for number in (1, 2):
            other.wait_until(lambda reach=number * STRIDE: walked() > reach - 1e-6, "a walk")
            poses.clear()
            other.expect("/initial_pose", 4)
            assert walked() == pytest.approx(number * STRIDE)
            other.publish("/elevation_mapping/elevation_map", grid_map)
        assert len(goals) == 2


def test_robot_sees_the_cliff_late_and_walks_around_it(tmp_path):
    command = [sys.executable, "-m", "grid_map_demos_py.launcher", "path_planner_demo"]
    with peer() as other:
        other.listen("/odom", Odometry, 10)
        other.listen("/plan", Path)
        demo = Process([*command, "--report", str(tmp_path)])
        try:
            other.wait_until(lambda: not demo.is_running, "the end of the demo")
        finally:
            demo.stop()
        walk = np.array([from_pose(message)[:2, 3] for message in other.received["/odom"]])
        plans = [path for path in other.received["/plan"] if path.poses]
    assert demo.returncode == 0, demo.text
    assert "Traceback" not in demo.text, demo.text
    rows = dict(re.findall(r"^ +(.+?) {2,}([\d.]+) m$", demo.text, re.MULTILINE))
    assert float(rows["straight line"]) == pytest.approx(math.dist(START, GOAL), abs=0.05)
    # The robot sees the cliff on the way, and walks around it.
    assert (
        float(rows["first plan"]) < 1.2 * float(rows["straight line"]) < float(rows["walked path"])
    )
    assert math.dist(walk[0], START) < 0.3
    assert math.dist(walk[-1], GOAL) < ARRIVED + 0.3
    starts = [path.poses[0].pose.position for path in plans]
    assert max(math.dist(START, (start.x, start.y)) for start in starts) > 1.0
    assert [path.name for path in tmp_path.iterdir()] == ["path_planner.png"]
    assert (tmp_path / "path_planner.png").stat().st_size > 50_000
