# SPDX-License-Identifier: BSD-3-Clause
"""Node `path_planner`: plans paths over a grid map, for RViz and as the planner server of Nav2."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, Pose as PoseMessage, PoseStamped, Quaternion
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.action.server import ActionServer, CancelResponse
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Header

from grid_map_core_py._packages import remedy_for
from grid_map_core_py.errors import MissingPackageError
from grid_map_core_py.planning import NoPathError, PathFailure
from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import ReceivedMap, from_pose, to_serialized_message
from .._planning import Planner, PlannerSettings, Pose, Poses
from ..errors import DROPPED, reason
from ..messages._fields import Matrix
from ..messages._packages import messages_of
from ..nodes import ConfiguredNode, MapPublisher, MapSubscription, map_qos
from ..nodes._health import LogThrottle, dropping, health_of
from ..nodes._parameters import follow_changes, read_fields
from ..nodes._poses import PACKAGE as TF, POSE_TYPES, TfPoses, chosen_source, has_tf
from ..nodes._scans import WAIT_PERIOD
from ..nodes._spin import steady_timer
from ..nodes._topics import LatchedSubscription, describe_topic

PATIENCE = 1.0
"""Maximum time that a goal of the action waits for a map and for transforms [s]."""

MISSING = (PathFailure.TF_ERROR, PathFailure.TIMEOUT)
"""Reasons that may go away while a goal waits."""

UNKNOWN = 200
"""Error code of `nav2_msgs/ComputePathToPose` for all errors but `NoPathError`."""


class Locator:
    """Returns poses in the frame `map_frame`.

    `source` of the robot poses is `tf`, or a key of `POSE_TYPES` with their `topic`. The methods
    raise `NoPathError` with `TF_ERROR` if a pose or a transform has not come, and other errors if
    a pose is invalid or tf2 is not installed.
    """

    def __init__(self, node: Node, source: str, topic: str) -> None:
        self.map_frame = ""
        self._node, self._source, self._topic = node, source, topic
        self._tf = TfPoses(node, "") if source == "tf" or has_tf() else None
        self._latest: Any = None
        if source != "tf":
            subscribe = partial(LatchedSubscription, hears_best_effort=True, is_counted=False)
            self._subscription = subscribe(node, POSE_TYPES[source], topic, self._keep)

    def _keep(self, message: Any) -> None:
        from_pose(message)  # Invalid poses are dropped.
        self._latest = message

    def robot(self, base_frame: str) -> Pose:
        """Return the pose of the robot."""
        if self._source == "tf":
            return _planar(self._transform(base_frame))
        if self._latest is None:
            topic = describe_topic(self._node, self._topic, POSE_TYPES[self._source])
            text = f"no pose of the robot has come on {topic}"
            raise NoPathError(text, PathFailure.TF_ERROR)
        return self.pose(self._latest)

    def pose(self, message: Any) -> Pose:
        """Return the pose of a message with a header."""
        return _planar(self._transform(message.header.frame_id) @ from_pose(message))

    def _transform(self, frame_id: str) -> Matrix:
        """Return the latest transform (4, 4) from a frame; an empty name is the map frame."""
        source, target = frame_id.removeprefix("/"), self.map_frame
        if source in ("", target):
            return np.eye(4)
        if self._tf is None:
            need = f"a pose in frame {source!r} for a map in frame {target!r}"
            raise MissingPackageError(TF, need, f"{remedy_for(TF)}, or send it in the map frame")
        self._tf.map_frame = target
        matrix = self._tf.frame_at(source, 0)
        if matrix is None:
            text = f"expected a transform from {source!r} to {target!r}: {self._tf.waits_for}"
            raise NoPathError(f"{text}. Publish it on /tf", PathFailure.TF_ERROR)
        return matrix


class PathPlannerNode(ConfiguredNode):
    """Plans on the latest map, and plans again when a map blocks the plan."""

    def __init__(self) -> None:
        super().__init__("path_planner")
        self._log, self._health = LogThrottle(self.get_logger()), health_of(self)
        self._health.drop_level = DiagnosticStatus.ERROR
        self._map_topic = self.read_topic("grid_map_topic", "/grid_map", "topic of the maps")
        about = (
            "source of the robot poses: `tf`, `odometry`, `pose` or `pose_with_covariance`; "
            "`auto` means `tf` if tf2 is installed, else `pose_with_covariance`"
        )
        source = self.read_choice("pose_source", ("auto", "tf", *POSE_TYPES), "auto", about)
        about = "topic of the robot poses; not used with tf"
        topic = self.read_topic("pose_topic", "initial_pose", about)
        self._settings = read_fields(self, PlannerSettings, read_only=False)
        self._locator = Locator(self, chosen_source(source, "pose_with_covariance"), topic)
        self._planner: Planner | None = None
        self._used, self._stale = time.monotonic(), ""
        self._goal: PoseStamped | None = None
        self._is_waiting, self._failure = False, ""
        self._plan: Poses = np.empty((0, 4))
        self._tick = Future()
        self._publisher = self.create_publisher(Path, "plan", map_qos())
        self._costs = MapPublisher(self, "cost_to_go", self._cost_to_go, self._log)
        self._goals = LatchedSubscription(
            self, PoseStamped, "goal_pose", self._on_goal, is_counted=False
        )
        self.create_service(GetPlan, "make_plan", self._make_plan)
        self._action = self._offer_to_nav2()
        self._subscription = MapSubscription(self, self._map_topic, self._on_map)
        follow_changes(self, self._settings, self._apply)
        steady_timer(self, WAIT_PERIOD, self._work)
        self.get_logger().info(f"plans on the maps of {self._subscription.topic_name}")

    def _offer_to_nav2(self) -> ActionServer | None:
        """Create the action and the service of Nav2's planner server, if `nav2_msgs` exists."""
        try:
            kind = messages_of("nav2_msgs", "compute_path_to_pose", "action").ComputePathToPose
        except MissingPackageError as error:
            self.get_logger().info(f"{error}. Without it, the node offers nothing to Nav2")
            return None
        service = messages_of("nav2_msgs", "is_path_valid", "srv").IsPathValid
        self.create_service(service, "is_path_valid", self._is_path_valid)
        execute, name = partial(self._execute, kind.Result), "compute_path_to_pose"
        return ActionServer(
            self, kind, name, execute, cancel_callback=lambda _: CancelResponse.ACCEPT
        )

    def _apply(self, settings: PlannerSettings) -> None:
        """Apply changed settings; resubscribe to receive a latched map again."""
        self._settings, self._planner = settings, None
        self._subscription.destroy()
        self._subscription = MapSubscription(self, self._map_topic, self._on_map)

    def _on_map(self, received: ReceivedMap) -> None:
        before, settings = self._planner, self._settings
        self._planner = Planner(received.decode(settings.layers, copy=False), settings)
        self._used, self._stale = time.monotonic(), ""
        self._locator.map_frame = received.frame_id
        is_like = before is not None and before.grid_map.frame_id == received.frame_id
        if not (is_like and len(self._plan) and self._is_free()):
            self._follow()
        self._costs.publish()

    def _is_free(self) -> bool:
        """Return whether the part of the plan ahead of the robot is free."""
        with suppress(*DROPPED):
            x, y, _ = self._locator.robot(self._settings.base_frame)
            distances = np.hypot(self._plan[:, 0] - x, self._plan[:, 1] - y)
            # The robot has already reached the nearest pose.
            return not self._fresh().blocked(self._plan[distances.argmin() :])[1:].any()
        return False

    def _fresh(self) -> Planner:
        """Return the planner on the latest map, or raise `NoPathError` with `TIMEOUT`."""
        if self._planner is None:
            topic = describe_topic(self, self._map_topic, GridMapMessage)
            text = self._stale or f"no usable map has come on {topic}"
            raise NoPathError(text, PathFailure.TIMEOUT)
        return self._planner

    def _work(self) -> None:
        """Discard a stale map, and let waiting goals try again."""
        limit = self._settings.stale_after
        if limit and time.monotonic() - self._used > limit and not self._stale:
            self._planner = None
            self._stale = f"no usable map of {self._subscription.topic_name} for {limit:g} s"
            remedy = "set stale_after to 0 for a map that is published once"
            self._log.warning(f"{self._stale}, no plans are sent; {remedy}")
        if self._is_waiting:
            self._follow()
        self._health.problem = self._stale or self._failure
        self._tick.set_result(None)
        self._tick = Future()

    def _on_goal(self, goal: PoseStamped) -> None:
        self._goal = goal
        self._follow()

    def _follow(self) -> None:
        """Plan to the goal of the topic; if there is no path, replace the plan by an empty one."""
        if self._goal is None:
            return
        self._is_waiting, self._failure = False, ""
        try:
            poses = self._planned(None, self._goal, self._settings.tolerance)
        except DROPPED as error:
            poses, self._failure = self._plan[:0], f"no plan: {reason(error)}"
            self._is_waiting = getattr(error, "reason", UNKNOWN) in MISSING
            self._log.error(self._failure)
        # While the map is stale, nothing is sent.
        if self._planner is not None and (len(poses) or len(self._plan)):
            self._send(poses)

    def _planned(self, start: PoseStamped | None, goal: PoseStamped, tolerance: float) -> Poses:
        """Return a plan; a start of None is the pose of the robot."""
        planner, robot = self._fresh(), self._settings.base_frame
        first = self._locator.robot(robot) if start is None else self._locator.pose(start)
        return planner.plan(first, self._locator.pose(goal), tolerance)

    def _send(self, poses: Poses) -> Path:
        """Publish a plan, which later maps can block; return its message."""
        self._plan, message = poses, self._message(poses)
        self._publisher.publish(message)
        self._costs.publish()
        return message

    def _message(self, poses: Poses) -> Path:
        frame_id, now = self._fresh().grid_map.frame_id, self.get_clock().now()
        path = Path(header=Header(stamp=now.to_msg(), frame_id=frame_id))
        for x, y, z, yaw in poses.tolist():
            turn = Quaternion(z=math.sin(0.5 * yaw), w=math.cos(0.5 * yaw))
            pose = PoseMessage(position=Point(x=x, y=y, z=z), orientation=turn)
            path.poses.append(PoseStamped(header=path.header, pose=pose))
        return path

    def _cost_to_go(self) -> bytes | None:
        """Return the map with the cost to the end of the plan; None if there is no fresh plan."""
        planner = self._planner
        if planner is None or not len(self._plan):
            return None
        costs = planner.graph.cost_to(self._plan[-1, :2]).costs
        return to_serialized_message(planner.grid_map.with_layers({"cost_to_go": costs}))

    def _make_plan(self, request: Any, response: Any) -> Any:
        with dropping(self._log, "make_plan"):
            start = request.start if request.start.header.frame_id else None
            response.plan = self._message(self._planned(start, request.goal, request.tolerance))
        return response

    async def _execute(self, make_result: Callable[[], Any], handle: Any) -> Any:
        request, result, begin = handle.request, make_result(), time.monotonic()
        while not handle.is_cancel_requested:
            try:
                start = request.start if request.use_start else None
                poses = self._planned(start, request.goal, self._settings.tolerance)
            except DROPPED as error:
                code = getattr(error, "reason", UNKNOWN)
                if code in MISSING and time.monotonic() - begin < PATIENCE:
                    await self._tick
                    continue
                self._log.error(f"compute_path_to_pose: {reason(error)}")
                result.error_code = int(code)
                if hasattr(result, "error_msg"):  # newer than the first messages of Jazzy
                    result.error_msg = reason(error)
                handle.abort()
                return result
            # From now on, the client decides when to plan again.
            self._goal, self._is_waiting, self._failure = None, False, ""
            result.path = self._send(poses)
            result.planning_time = Duration(seconds=time.monotonic() - begin).to_msg()
            handle.succeed()
            return result
        handle.canceled()
        return result

    def _is_path_valid(self, request: Any, response: Any) -> Any:
        """Check a whole path; an empty path is not valid."""
        with dropping(self._log, "is_path_valid"):
            planner, path = self._fresh(), request.path
            for pose in path.poses:
                pose.header.frame_id = path.header.frame_id
            poses = np.reshape([self._locator.pose(pose) for pose in path.poses], (-1, 3))
            (blocked,) = planner.blocked(poses).nonzero()
            response.invalid_pose_indices = blocked.tolist()
            response.is_valid = len(poses) > 0 and not len(blocked)
        return response


def _planar(matrix: Matrix) -> Pose:
    """Return x, y [m] and yaw [rad] of a (4, 4) transform."""
    return matrix[0, 3], matrix[1, 3], math.atan2(matrix[1, 0], matrix[0, 0])


if __name__ == "__main__":
    raise SystemExit(PathPlannerNode.main())
