# SPDX-License-Identifier: BSD-3-Clause
"""The path planner demo: the walking robot, and all nodes together."""

import math
import re
import sys

import numpy as np
import pytest
from nav_msgs.msg import Odometry, Path

from grid_map_core_py import GridMap
from grid_map_demos_py.report_node import draw_walk, length_of
from grid_map_demos_py.robot_course import ARRIVED, GOAL, START, Walker
from grid_map_ros_py import from_pose
from grid_map_ros_py.testing import Process, peer


def test_walker_follows_the_latest_plan_at_its_speed():
    walker = Walker((0.0, 0.0), (1.0, 0.0))
    walker.walk(0.5)
    assert (walker.position.tolist(), walker.way.tolist()) == ([0.0, 0.0], [1.0, 0.0])
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


def test_picture_shows_all_plans_and_the_walk():
    truth = GridMap((12.0, 12.0), 1.0, layers={"elevation": 0.0})
    truth["elevation"][2, 3] = 1.0
    costs = GridMap((12.0, 12.0), 1.0, layers={"inflated_cost": 7.0})
    plans = [np.array([START, GOAL]), np.array([START, (0.0, 0.0), GOAL])]
    figure = draw_walk(truth, costs, plans, plans[1])
    for ax in figure.axes[:2]:
        lines = [line.get_xydata() for line in ax.lines]
        for line in (*plans, plans[1]):
            assert any(np.array_equal(drawn, line) for drawn in lines)
    assert length_of(plans[0]) == pytest.approx(math.dist(START, GOAL))


def test_robot_plans_again_and_walks_to_the_goal(tmp_path):
    command = [sys.executable, "-m", "grid_map_demos_py.launcher", "path_planner_demo"]
    with peer() as other:
        other.listen("/odom", Odometry, 10)
        other.listen("/plan", Path)
        demo = Process([*command, "--report", str(tmp_path)])
        try:
            other.wait_until(lambda: not demo.is_running, "the end of the demo")
        finally:
            demo.kill()
        walk = np.array([from_pose(message)[:2, 3] for message in other.received["/odom"]])
        plans = [path for path in other.received["/plan"] if path.poses]
    assert demo.returncode == 0, demo.text
    assert "Traceback" not in demo.text, demo.text
    rows = dict(re.findall(r"^ +(.+?) {2,}([\d.]+)", demo.text, re.MULTILINE))
    assert float(rows["straight line"]) == pytest.approx(math.dist(START, GOAL), abs=0.05)
    assert int(rows["plans"]) >= 2
    assert len(plans) >= 2
    assert float(rows["walked"]) > 1.2 * float(rows["straight line"])
    assert [path.name for path in tmp_path.iterdir()] == ["path_planner.png"]
    assert (tmp_path / "path_planner.png").stat().st_size > 50_000
    assert math.dist(walk[0], START) < 0.3
    assert math.dist(walk[-1], GOAL) < ARRIVED + 0.3
