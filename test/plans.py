# SPDX-License-Identifier: BSD-3-Clause
"""Tests of `path_planner` with messages of Nav2 and tf2, run by test_optional_messages.py."""

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav2_msgs.action import ComputePathToPose
from nav2_msgs.srv import IsPathValid
from nav_msgs.msg import Path
from rclpy.action import ActionClient
from tf2_msgs.msg import TFMessage

from grid_map_core_py import GridMap
from grid_map_core_py.planning import TravelGraph
from grid_map_ros_py import to_message
from grid_map_ros_py.messages import to_transform
from grid_map_ros_py.nodes._poses import from_xyz_rpy
from grid_map_ros_py.testing import Peer, Process, peer, running

MODULE = "grid_map_ros_py._executables.path_planner"
PATIENT = f"import {MODULE} as module; module.PATIENCE = 1e9; module.PathPlannerNode.main()"
"""Program of a node that waits for a transform until its goal is canceled."""

START, GOAL = (-1.4, 0.1), (1.4, -0.2)
TURN = from_xyz_rpy((1.0, -2.0, 0.0), (0.0, 0.0, 0.7))
"""Transform from the frame `odom` to the frame `map`."""


def ground(gap: float = -1.0) -> GridMap:
    """Return a map with a wall at x = 0, which has a gap of 0.4 m around y = `gap`."""
    grid_map = GridMap((4.0, 3.0), 0.1, layers={"elevation": 0.5}, frame_id="odom")
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    grid_map["cost"] = np.where((abs(x) < 0.16) & (abs(y - gap) > 0.2), 254.0, 0.0)
    grid_map["cost"][x > 1.7] = np.nan
    return grid_map


def pose(x: float, y: float, frame_id: str = "odom") -> PoseStamped:
    message = PoseStamped()
    message.header.frame_id = frame_id
    message.pose.position.x, message.pose.position.y = x, y
    return message


class Client:
    """Client of the planner server."""

    def __init__(self, other: Peer, node: Process) -> None:
        self.peer, self.node = other, node
        self._action = ActionClient(other.node, ComputePathToPose, "/compute_path_to_pose")
        other.wait_until(self._action.server_is_ready, "the action")
        other.listen("/plan", Path)

    def send(self, goal: PoseStamped, start: PoseStamped | None = None) -> Any:
        """Return the handle of an accepted goal; without a start, that is the robot."""
        request = ComputePathToPose.Goal(goal=goal, use_start=start is not None)
        request.start = start or PoseStamped()
        answer = self._action.send_goal_async(request)
        self.peer.wait_until(answer.done, "an answer")
        assert answer.result().accepted
        return answer.result()

    def result(self, handle: Any) -> tuple[int, Any]:
        """Return the status and the result."""
        answer = handle.get_result_async()
        self.peer.wait_until(answer.done, "a result")
        return answer.result().status, answer.result().result

    def wait_for(self, text: str) -> None:
        """Wait until the node has logged a text."""
        self.peer.wait_until(lambda: text in self.node.text, text)


@contextmanager
def planner(program: tuple[str, ...] = ("-m", MODULE), **parameters: object) -> Iterator[Client]:
    words = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    process = Process([sys.executable, *program, "--ros-args", *words])
    with peer() as other, running(process):
        yield Client(other, process)


def expected(grid_map: GridMap, start: Any = START, goal: Any = GOAL) -> float:
    """Return the length of the path that the library finds."""
    graph = TravelGraph(grid_map, cost="cost", elevation="elevation", lethal=253.0)
    return length_of(graph.path(start, goal).positions)


def length_of(line: Any) -> float:
    return float(np.hypot(*np.diff(np.asarray(line)[:, :2], axis=0).T).sum())


def positions_of(path: Path) -> np.ndarray:
    return np.array([(p.x, p.y) for p in (one.pose.position for one in path.poses)]).reshape(-1, 2)


ERRORS = [
    (203, (-9.0, 0.0), GOAL),
    (204, START, (9.0, 0.0)),
    (205, (0.0, 1.0), GOAL),
    (206, START, (0.0, 1.0)),
    (206, START, (1.8, 0.0)),
]


def test_action_reports_the_error_codes_of_nav2() -> None:
    with planner() as client:
        status, result = client.result(client.send(pose(*GOAL), pose(*START)))
        assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, 207)
        client.wait_for("compute_path_to_pose: no usable map has come on /grid_map")
        client.peer.publish("/grid_map", to_message(ground()))
        wait_for_map(client, is_valid=True)
        for code, start, goal in ERRORS:
            status, result = client.result(client.send(pose(*goal), pose(*start)))
            assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, code)
        client.wait_for("compute_path_to_pose: goal: expected a position on the map")
        status, result = client.result(client.send(pose(math.nan, 0.0), pose(*START)))
        assert result.error_code == 200
        client.wait_for("pose.position.x: expected a finite number, got nan")
        for start, frame in ((None, "base_link"), (pose(*START, "elsewhere"), "elsewhere")):
            _, result = client.result(client.send(pose(*GOAL), start))
            assert result.error_code == 202
            text = f"expected a transform from {frame!r} to 'odom': {frame!r} passed to lookup"
            client.wait_for(f"compute_path_to_pose: {text}")
        client.peer.publish("/grid_map", to_message(ground(9.0)))
        wait_for_map(client, is_valid=False)
        status, result = client.result(client.send(pose(*GOAL), pose(*START)))
        assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, 208)
        assert client.peer.received["/plan"] == []


def wait_for_map(client: Client, *, is_valid: bool) -> None:
    """Wait until the node has a map on which a way through the lower gap is valid or not."""
    way = Path(poses=[pose(0.05 * k, -1.0) for k in range(-10, 10)])
    way.header.frame_id = "odom"
    client.peer.wait_until(lambda: validity(client, way).is_valid == is_valid, "another map")


def validity(client: Client, path: Path) -> Any:
    service = client.peer.node.create_client(IsPathValid, "/is_path_valid")
    client.peer.wait_until(service.service_is_ready, "the service")
    answer = service.call_async(IsPathValid.Request(path=path))
    client.peer.wait_until(answer.done, "an answer")
    client.peer.node.destroy_client(service)
    return answer.result()


def test_canceled_goal_ends_and_the_next_one_gives_a_plan() -> None:
    with planner(("-c", PATIENT)) as client:
        client.peer.publish("/grid_map", to_message(ground()))
        handle = client.send(pose(*GOAL))
        answer = handle.cancel_goal_async()
        client.peer.wait_until(answer.done, "an answer")
        assert len(answer.result().goals_canceling) == 1
        status, result = client.result(handle)
        assert (status, len(result.path.poses)) == (GoalStatus.STATUS_CANCELED, 0)
        status, result = client.result(client.send(pose(*GOAL), pose(*START)))
        assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0)
        positions = positions_of(result.path)
        assert length_of(positions) == pytest.approx(expected(ground()))
        np.testing.assert_allclose(positions[[0, -1]], [START, GOAL])
        assert result.planning_time.sec == 0 < result.planning_time.nanosec
        assert client.peer.expect("/plan") == result.path


def test_goal_in_a_rotated_frame_and_robot_come_from_tf2() -> None:
    with planner() as client:
        client.peer.publish("/grid_map", to_message(ground()))
        robot = from_xyz_rpy((*START, 0.6), (0.0, 0.0, 0.3))
        transforms = TFMessage()
        # The stand-in for tf2 knows only transforms in this direction.
        for child, matrix in (("map", np.linalg.inv(TURN)), ("base_link", robot)):
            transform = TransformStamped(child_frame_id=child, transform=to_transform(matrix))
            transform.header.frame_id = "odom"
            transforms.transforms.append(transform)
        client.peer.publish("/tf_static", transforms)
        goal_x, goal_y, *_ = TURN @ [*GOAL, 0.0, 1.0]
        client.peer.publish("/goal_pose", pose(goal_x, goal_y, "map"))
        path = client.peer.expect("/plan")
        assert path.header.frame_id == "odom"
        np.testing.assert_allclose(positions_of(path)[[0, -1]], [START, GOAL])
        assert length_of(positions_of(path)) == pytest.approx(expected(ground()))
        turn = path.poses[-1].pose.orientation
        assert 2.0 * math.atan2(turn.z, turn.w) == pytest.approx(-0.7)
        # Another map blocks the plan.
        client.peer.publish("/grid_map", to_message(ground(1.0)))
        found = length_of(positions_of(client.peer.expect("/plan", 2)))
        assert found == pytest.approx(expected(ground(1.0)))
        # After a goal of the action, the client decides when to plan again.
        status, _ = client.result(client.send(pose(-1.0, 1.0)))
        assert status == GoalStatus.STATUS_SUCCEEDED
        client.peer.expect("/plan", 3)
        client.peer.publish("/grid_map", to_message(ground()))
        wait_for_map(client, is_valid=True)
        assert len(client.peer.received["/plan"]) == 3


def test_service_names_the_blocked_poses_of_a_path() -> None:
    with planner() as client:
        client.peer.publish("/grid_map", to_message(ground()))
        wait_for_map(client, is_valid=True)
        path = Path(poses=[pose(-1.0 + 0.1 * k, 0.0) for k in range(21)])
        path.header.frame_id = "odom"
        answer = validity(client, path)
        # The cells of the wall are those from x = -0.2 to 0.2.
        assert not answer.is_valid
        assert {9, 10, 11} <= {*answer.invalid_pose_indices} <= {*range(8, 14)}
        assert validity(client, Path(poses=path.poses[:5], header=path.header)).is_valid
        assert not validity(client, Path(header=path.header)).is_valid
        path.header.frame_id = "elsewhere"
        assert not validity(client, path).is_valid
        client.wait_for("is_path_valid: expected a transform from 'elsewhere' to 'odom'")
