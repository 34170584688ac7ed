# SPDX-License-Identifier: BSD-3-Clause
"""Node `path_planner`: plans paths over a grid map, for RViz and as the planner server of Nav2."""

import math
import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rcl_interfaces.msg import SetParametersResult
from rclpy.action.server import ActionServer, CancelResponse
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter

from grid_map_core_py._arrays._checks import Mask
from grid_map_core_py._packages import remedy_for
from grid_map_core_py._parameters import build
from grid_map_core_py.errors import GridMapError, MissingPackageError
from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import ReceivedMap, from_pose, to_serialized_message
from .._planning import (
    TF_ERROR,
    TIMEOUT,
    PlanError,
    Planner,
    PlannerSettings,
    Pose,
    Poses,
    code_of,
    to_path,
    yaw_of,
)
from ..errors import DROPPED, reason
from ..messages._fields import Matrix
from ..messages._packages import messages_of
from ..nodes import ConfiguredNode, MapPublisher, MapSubscription, map_qos
from ..nodes._health import LogThrottle, dropping, health_of
from ..nodes._parameters import read_fields
from ..nodes._poses import PACKAGE as TF, POSE_TYPES, TfPoses, chosen_source, has_tf
from ..nodes._scans import WAIT_PERIOD
from ..nodes._spin import steady_timer
from ..nodes._topics import LatchedSubscription, describe_topic, listen

POSE_SOURCES = ("auto", "tf", *POSE_TYPES)

PATIENCE = 1.0
"""Maximum wait of a goal for a map and for transforms [s]."""


class Locator:
    """Transforms poses to the frame of the map, and knows the pose of the robot.

    All methods raise `PlanError` if a pose or a transform is missing, and `MessageError` if a pose
    is invalid.

    Args:
        node: the node.
        source: `tf`, or a key of `POSE_TYPES`.
        topic: topic of the robot poses, unless they come from tf.
        log: logs invalid poses.
    """

    def __init__(self, node: Node, source: str, topic: str, log: LogThrottle) -> None:
        self._node, self._map_frame, self._source, self._topic = node, "", source, topic
        self._tf: TfPoses | None = None
        self._latest: Any = None
        if source == "odometry":
            listen(node, POSE_TYPES[source], topic, self._keep, log, "a pose")
        elif source != "tf":
            # A single pose must not get lost.
            options: Any = {"hears_best_effort": True, "is_counted": False}
            self._subscription = LatchedSubscription(
                node, POSE_TYPES[source], topic, self._keep, **options
            )

    def _keep(self, message: Any) -> None:
        from_pose(message)  # Invalid poses are dropped.
        self._latest = message

    def use(self, map_frame: str) -> None:
        """Set the frame of the map; listen to tf2 if it is installed."""
        if map_frame != self._map_frame:
            self._map_frame = map_frame
            self._tf = TfPoses(self._node, map_frame) if has_tf() else None

    def pose(self, message: Any) -> Pose:
        """Return x, y [m] and yaw [rad] of a pose with a header, in the frame of the map."""
        matrix = self._transform(message.header.frame_id) @ from_pose(message)
        return matrix[0, 3], matrix[1, 3], yaw_of(matrix)

    def robot(self, base_frame: str) -> Pose:
        """Return x, y [m] and yaw [rad] of the robot, in the frame of the map."""
        if self._source == "tf":
            matrix = self._transform(base_frame)
            return matrix[0, 3], matrix[1, 3], yaw_of(matrix)
        if self._latest is None:
            topic = describe_topic(self._node, self._topic, POSE_TYPES[self._source])
            raise PlanError(TF_ERROR, f"no pose of the robot has come on {topic}")
        return self.pose(self._latest)

    def _transform(self, frame_id: str) -> Matrix:
        """Return the latest transform (4, 4) from a frame; an empty name is the map frame."""
        source, target = frame_id.removeprefix("/"), self._map_frame
        if source in ("", target):
            return np.eye(4)
        if self._tf is None:
            need = f"a pose in frame {source!r} for a map in frame {target!r}"
            remedy = f"{remedy_for(TF)}, or send it in the map frame"
            raise PlanError(TF_ERROR, str(MissingPackageError(TF, need, remedy)))
        matrix = self._tf.frame_at(source, 0)
        if matrix is None:
            text = f"expected a transform from {source!r} to {target!r}: {self._tf.waits_for}"
            raise PlanError(TF_ERROR, f"{text}. Publish it on /tf")
        return matrix


@dataclass(eq=False)
class Request:
    """A goal that waits for a map or for transforms.

    Attributes:
        goal: pose of the goal.
        start: pose of the start; None means the pose of the robot.
        handle: goal handle of the action; None if the goal came from the topic.
        since: time of arrival [s].
        reported: error code that has been logged; then a goal of the topic still waits.
    """

    goal: PoseStamped
    start: PoseStamped | None
    handle: Any
    since: float
    reported: int = 0

    @property
    def is_over(self) -> bool:
        """True if the client has canceled the goal, or the goal has waited too long."""
        is_canceled = self.handle is not None and self.handle.is_cancel_requested
        return is_canceled or time.monotonic() - self.since > PATIENCE


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
        source = self.read_choice("pose_source", POSE_SOURCES, "auto", about)
        about = "topic of the robot poses; not used with tf"
        topic = self.read_topic("pose_topic", "initial_pose", about)
        self._next = self._settings = read_fields(self, PlannerSettings, read_only=False)
        if source == "tf" and not has_tf():
            remedy = f"{remedy_for(TF)}, or take another pose_source"
            raise MissingPackageError(TF, "pose_source 'tf'", remedy)
        source = chosen_source(source, "pose_with_covariance")
        self._locator = Locator(self, source, topic, self._log)
        self._planner: Planner | None = None
        self._used, self._is_stale, self._failure = time.monotonic(), False, ""
        self._goal: PoseStamped | None = None
        # `_tight` are poses that count as blocked although the plan is new; see `Planner.blocked`.
        self._plan: Poses = np.empty((0, 4))
        self._tight: Mask = np.empty(0, np.bool_)
        self._requests: list[Request] = []
        self._details = {"plans": 0, "repeated plans": 0, "ms of the last plan": math.nan}
        self._health.details = lambda: self._details
        self._publisher = self.create_publisher(Path, "plan", map_qos())
        self._costs = MapPublisher(self, "cost_to_go", self._cost_to_go, self._log)
        self._goals = LatchedSubscription(
            self, PoseStamped, "goal_pose", self._on_goal, is_counted=False
        )
        self.create_service(GetPlan, "make_plan", self._make_plan)
        self._action = self._offer_to_nav2()
        self._subscription = MapSubscription(self, self._map_topic, self._on_map)
        self.add_on_set_parameters_callback(self._check_changes)
        self.add_post_set_parameters_callback(self._apply_changes)
        steady_timer(self, WAIT_PERIOD, self._work)
        topics = self._subscription.topic_name, self._publisher.topic_name
        self.get_logger().info("plans on {}, publishes the plans on {}".format(*topics))

    def _offer_to_nav2(self) -> ActionServer | None:
        """Create the action and the service of Nav2's planner server, if `nav2_msgs` exists."""
        try:
            kind = messages_of("nav2_msgs", "compute_path_to_pose", "action").ComputePathToPose
        except MissingPackageError as error:
            self.get_logger().info(f"{error}. Without it, the node offers nothing to Nav2")
            return None
        service = messages_of("nav2_msgs", "is_path_valid", "srv").IsPathValid
        self.create_service(service, "is_path_valid", self._is_path_valid)
        return ActionServer(
            self,
            kind,
            "compute_path_to_pose",
            lambda handle: self._execute(handle, kind.Result()),
            handle_accepted_callback=self._accept,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def destroy_node(self) -> None:
        """Destroy the action and the node."""
        if self._action is not None:
            self._action.destroy()
        Node.destroy_node(self)

    # --- parameters -------------------------------------------------------------------------------

    def _check_changes(self, changes: list[Parameter]) -> SetParametersResult:
        values = asdict(self._settings)
        values |= {change.name: change.value for change in changes if change.name in values}
        try:
            self._next = build(PlannerSettings, values)
        except GridMapError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_changes(self, _changes: list[Parameter]) -> None:
        """Apply changed settings; resubscribe to receive a latched map again."""
        if self._next != self._settings:
            self._settings, self._planner = self._next, None
            self._subscription.destroy()
            self._subscription = MapSubscription(self, self._map_topic, self._on_map)

    # --- maps -------------------------------------------------------------------------------------

    def _on_map(self, received: ReceivedMap) -> None:
        before, settings = self._planner, self._settings
        self._planner = Planner(received.decode(settings.layers, copy=False), settings)
        self._used, self._is_stale = time.monotonic(), False
        self._locator.use(self._planner.frame_id)
        is_like = before is not None and before.frame_id == self._planner.frame_id
        if any(request.handle is None for request in self._requests):
            self._work()
        elif self._goal is not None and not (is_like and self._is_free()):
            self._details["repeated plans"] += len(self._plan) > 0
            self._follow()
        self._costs.publish()

    def _is_free(self) -> bool:
        """Return whether there is a plan, and the map is free in the part ahead of the robot."""
        with dropping(self._log, "cannot check the plan"):
            planner, ahead = self._fresh(), slice(self._passed(self._plan), None)
            poses = self._plan[ahead]
            blocked = planner.blocked(poses) & ~self._tight[ahead] | planner.occupied(poses)
            # The robot has already reached the first of these poses.
            return len(poses) > 0 and not blocked[1:].any()
        return False

    def _passed(self, poses: Poses) -> int:
        """Return the index of the pose nearest to the robot; 0 if the robot's pose is unknown."""
        try:
            x, y, _ = self._locator.robot(self._settings.base_frame)
        except GridMapError:
            return 0
        return int(np.argmin(np.hypot(poses[:, 0] - x, poses[:, 1] - y))) if len(poses) else 0

    def _fresh(self) -> Planner:
        """Return the planner on the latest map, or raise `PlanError` if that is stale."""
        if self._is_stale:
            raise PlanError(TIMEOUT, self._stale_text())
        if self._planner is None:
            topic = describe_topic(self, self._map_topic, GridMapMessage)
            raise PlanError(TIMEOUT, f"no usable map has come on {topic}")
        return self._planner

    def _stale_text(self) -> str:
        topic, limit = self._subscription.topic_name, self._settings.stale_after
        return f"no usable map of {topic} for {limit:g} s"

    def _work(self) -> None:
        """Process goals that have waited; note whether the map is stale."""
        for request in [*self._requests]:
            missing = self._missing(request)
            if not missing or (request.is_over and missing != request.reported):
                request.reported = missing
                if not missing or request.handle is not None:
                    self._requests.remove(request)
                if request.handle is None:
                    self._follow()
                else:
                    request.handle.execute()
        limit = self._settings.stale_after
        if limit and time.monotonic() - self._used > limit and not self._is_stale:
            self._is_stale = True
            remedy = "set stale_after to 0 for a map that is published once"
            self._log.warning(f"{self._stale_text()}, no plans are sent; {remedy}")
        self._health.problem = self._stale_text() if self._is_stale else self._failure

    # --- plans ------------------------------------------------------------------------------------

    def _ends(self, start: PoseStamped | None, goal: PoseStamped) -> tuple[Planner, Pose, Pose]:
        """Return the planner, the start and the goal; a start of None is the robot's pose."""
        planner = self._fresh()
        robot = self._settings.base_frame
        begin = self._locator.robot(robot) if start is None else self._locator.pose(start)
        return planner, begin, self._locator.pose(goal)

    def _missing(self, request: Request) -> int:
        """Return the error code of missing data that may still arrive; 0 if there is none."""
        try:
            self._ends(request.start, request.goal)
        except PlanError as error:
            return error.code
        except DROPPED:
            return 0
        return 0

    def _planned(self, start: PoseStamped | None, goal: PoseStamped, tolerance: float) -> Poses:
        """Return a plan; a start of None is the pose of the robot."""
        begin = time.perf_counter()
        planner, first, last = self._ends(start, goal)
        poses = planner.plan(first, last, tolerance)
        self._details["plans"] += 1
        self._details["ms of the last plan"] = round(1e3 * (time.perf_counter() - begin), 1)
        return poses

    def _follow(self) -> None:
        """Plan to the goal of the topic; if there is no path, replace the plan by an empty one."""
        if self._goal is None:
            return
        self._failure = ""
        try:
            self._send(self._planned(None, self._goal, self._settings.tolerance))
        except DROPPED as error:
            self._failure = f"no plan: {reason(error)}"
            self._log.error(self._failure)
            # While the map is stale, nothing is sent.
            if code_of(error) != TIMEOUT and len(self._plan):
                self._send(self._plan[:0])

    def _send(self, poses: Poses) -> Path:
        """Publish a plan, which later maps can block; return its message."""
        self._plan, self._tight = poses, self._fresh().blocked(poses)
        message = self._message(poses)
        self._publisher.publish(message)
        self._costs.publish()
        return message

    def _message(self, poses: Poses) -> Path:
        return to_path(poses, self._fresh().frame_id, self.get_clock().now().nanoseconds)

    def _cost_to_go(self) -> bytes | None:
        """Return the map with the cost to the end of the plan; None if there is no fresh plan."""
        if self._planner is None or self._is_stale or not len(self._plan):
            return None
        return to_serialized_message(self._planner.cost_to_go(self._plan[-1]))

    # --- goals ------------------------------------------------------------------------------------

    def _on_goal(self, goal: PoseStamped) -> None:
        self._goal = goal
        self._requests = [one for one in self._requests if one.handle is not None]
        self._requests.append(Request(goal, None, None, time.monotonic()))
        self._work()

    def _make_plan(self, request: Any, response: Any) -> Any:
        with dropping(self._log, "make_plan"):
            start = request.start if request.start.header.frame_id else None
            response.plan = self._message(self._planned(start, request.goal, request.tolerance))
        return response

    def _accept(self, handle: Any) -> None:
        request = handle.request
        start = request.start if request.use_start else None
        self._requests.append(Request(request.goal, start, handle, time.monotonic()))
        self._work()

    def _execute(self, handle: Any, result: Any) -> Any:
        if handle.is_cancel_requested:
            handle.canceled()
            return result
        begin, request = time.perf_counter(), handle.request
        try:
            start = request.start if request.use_start else None
            poses = self._planned(start, request.goal, self._settings.tolerance)
        except DROPPED as error:
            self._log.error(f"compute_path_to_pose: {reason(error)}")
            result.error_code = code_of(error)
            # Not in the first messages of Jazzy.
            if hasattr(result, "error_msg"):
                result.error_msg = reason(error)
            handle.abort()
        else:
            # From now on, the client decides when to plan again.
            self._goal, self._failure = None, ""
            result.path = self._send(poses)
            handle.succeed()
        result.planning_time = Duration(seconds=time.perf_counter() - begin).to_msg()
        return result

    def _is_path_valid(self, request: Any, response: Any) -> Any:
        """Check the part of a path ahead of the robot; an empty path is not valid."""
        with dropping(self._log, "is_path_valid"):
            planner, path = self._fresh(), request.path
            for pose in path.poses:
                pose.header.frame_id = path.header.frame_id
            poses = np.reshape([self._locator.pose(pose) for pose in path.poses], (-1, 3))
            poses = np.insert(poses, 2, 0.0, axis=1)
            first = self._passed(poses)
            blocked = first + np.flatnonzero(planner.blocked(poses[first:]))
            response.invalid_pose_indices = blocked.tolist()
            response.is_valid = len(poses) > 0 and not len(blocked)
            # Not in Jazzy.
            if hasattr(response, "success"):
                response.success = True
        return response


if __name__ == "__main__":
    raise SystemExit(PathPlannerNode.main())
