# SPDX-License-Identifier: BSD-3-Clause
"""Node `path_planner`: plans paths over a grid map, for RViz and as the planner server of Nav2."""

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.action.server import ActionServer, CancelResponse
from rclpy.duration import Duration
from rclpy.task import Future
from std_msgs.msg import Header

from grid_map_core_py._arrays import Positions
from grid_map_core_py._packages import remedy_for
from grid_map_core_py.errors import MissingPackageError
from grid_map_core_py.planning import NoPathError, Path as FoundPath, PathFailure
from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import ReceivedMap, from_pose, to_serialized_message
from .._planning import Planner, PlannerSettings
from ..errors import DROPPED, reason
from ..messages._packages import messages_of
from ..nodes import ConfiguredNode, MapPublisher, MapSubscription, map_qos
from ..nodes._health import LogThrottle, dropping, health_of
from ..nodes._parameters import follow_changes, read_fields
from ..nodes._poses import PACKAGE as TF, TfPoses, frame_name, has_tf
from ..nodes._scans import WAIT_PERIOD
from ..nodes._spin import steady_timer
from ..nodes._topics import LatchedSubscription, describe_topic

PATIENCE = 1.0
"""Maximum time that a goal of the action waits for a map and for transforms [s]."""

MISSING = (PathFailure.TF_ERROR, PathFailure.TIMEOUT)
"""Reasons that may go away while a goal waits."""

UNKNOWN = 200
"""Error code of `nav2_msgs/ComputePathToPose` for all errors but `NoPathError`."""


class PathPlannerNode(ConfiguredNode):
    """Plans paths on the latest map, and plans again when a new map blocks the current path."""

    def __init__(self) -> None:
        super().__init__("path_planner")
        self._log, self._health = LogThrottle(self.get_logger()), health_of(self)
        self._health.drop_level = DiagnosticStatus.ERROR
        self._map_topic = self.read_topic("grid_map_topic", "/grid_map", "topic of grid maps")
        self._settings = read_fields(self, PlannerSettings, read_only=False)
        self._tf = TfPoses(self, "") if has_tf() else None
        self._planner: Planner | None = None
        self._used = time.monotonic()
        self._initial_pose: PoseWithCovarianceStamped | None = None
        self._goal: PoseStamped | None = None
        self._failure: Exception | None = None
        # Positions of the plan; empty without one.
        self._plan: Positions = np.empty((0, 2))
        self._tick = Future()
        self._publisher = self.create_publisher(Path, "plan", map_qos())
        self._costs = MapPublisher(self, "cost_to_go", self._cost_to_go, self._log)
        subscribe = partial(LatchedSubscription, self, is_counted=False)
        self._inputs = (
            subscribe(PoseWithCovarianceStamped, "initial_pose", self._on_initial_pose),
            subscribe(PoseStamped, "goal_pose", self._on_goal),
        )
        self.create_service(GetPlan, "make_plan", self._make_plan)
        self._action = self._offer_to_nav2()
        self._subscription = MapSubscription(self, self._map_topic, self._on_map)
        follow_changes(self, self._settings, self._apply)
        steady_timer(self, WAIT_PERIOD, self._work)
        self.get_logger().info(f"plans on the maps of {self._subscription.topic_name}")

    def _offer_to_nav2(self) -> ActionServer | None:
        """Create the interfaces of Nav2's planner server, if `nav2_msgs` is installed."""
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
        self._used, self._failure = time.monotonic(), None
        is_like = before is not None and before.grid_map.frame_id == received.frame_id
        # The robot has left the first position.
        if not (is_like and len(self._plan)) or self._planner.blocked(self._plan)[1:].any():
            self._follow()
        self._costs.publish()

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        from_pose(message)  # Invalid poses are dropped.
        self._initial_pose = message

    def _on_goal(self, goal: PoseStamped) -> None:
        self._goal = goal
        self._follow()

    def _work(self) -> None:
        """Discard a stale map, and let waiting goals try again."""
        limit = self._settings.stale_after
        if limit and time.monotonic() - self._used > limit:
            self._planner, self._used = None, math.inf
            self._fail(self._no_map())
        elif getattr(self._failure, "reason", UNKNOWN) in MISSING:
            self._follow()
        self._health.problem = f"no plan: {reason(self._failure)}" if self._failure else ""
        self._tick.set_result(None)
        self._tick = Future()

    def _fail(self, error: Exception) -> None:
        self._failure = error
        self._log.error(f"no plan: {reason(error)}")

    def _follow(self) -> None:
        """Plan to the last received goal; if there is no path, publish an empty plan."""
        if self._goal is None:
            return
        self._failure = None
        try:
            self._send(self._path(None, self._goal, self._settings.tolerance))
        except DROPPED as error:
            self._fail(error)
            # While the map is stale, nothing is sent.
            if self._planner is not None and len(self._plan):
                self._send(None)

    def _no_map(self) -> NoPathError:
        topic = describe_topic(self, self._map_topic, GridMapMessage)
        text, limit = f"no usable map has come on {topic}", self._settings.stale_after
        if limit:
            remedy = "set stale_after to 0 for a map that is published once"
            text = f"{text} in the last {limit:g} s; {remedy}"
        return NoPathError(text, PathFailure.TIMEOUT)

    def _fresh(self) -> Planner:
        """Return the planner for the latest map; raise `NoPathError` if there is no map."""
        if self._planner is None:
            raise self._no_map()
        return self._planner

    def _robot(self) -> Any:
        """Return the robot pose as a message; raise `NoPathError` if it is unknown."""
        if self._tf and (base_frame := self._settings.base_frame):
            return PoseStamped(header=Header(frame_id=base_frame))
        if self._initial_pose is None:
            topic = describe_topic(self, "initial_pose", PoseWithCovarianceStamped)
            why = "" if self._tf else ", and tf2_ros is not installed"
            text = f"no pose of the robot has come on {topic}{why}"
            raise NoPathError(text, PathFailure.TF_ERROR)
        return self._initial_pose

    def _pose(self, message: Any) -> tuple[float, float, float]:
        """Return x, y and yaw of a pose in the map frame; raise `NoPathError` without a transform.

        An empty `frame_id` means the map frame.
        """
        pose, source = from_pose(message), frame_name(message.header.frame_id)
        target = frame_name(self._fresh().grid_map.frame_id)
        if source not in ("", target):
            if self._tf is None:
                need = f"a pose in frame {source!r} for a map in frame {target!r}"
                remedy = f"{remedy_for(TF)}, or send it in the map frame"
                raise MissingPackageError(TF, need, remedy)
            self._tf.map_frame = target
            transform = self._tf.frame_at(source, 0)
            if transform is None:
                text = f"expected a transform from {source!r} to {target!r}: {self._tf.waits_for}"
                raise NoPathError(f"{text}. Publish it on /tf", PathFailure.TF_ERROR)
            pose = transform @ pose
        return pose[0, 3], pose[1, 3], math.atan2(pose[1, 0], pose[0, 0])

    def _path(self, start: PoseStamped | None, goal: PoseStamped, tolerance: float) -> FoundPath:
        """Return a path between two poses, starting at the robot if `start` is None."""
        graph = self._fresh().graph
        begin, end = self._pose(start or self._robot()), self._pose(goal)
        return graph.path(begin, end, tolerance=tolerance)

    def _send(self, path: FoundPath | None) -> Path:
        """Publish and store a plan, and return its message."""
        self._plan = self._plan[:0] if path is None else path.positions
        message = self._message(path)
        self._publisher.publish(message)
        self._costs.publish()
        return message

    def _message(self, path: FoundPath | None) -> Path:
        frame_id, now = self._fresh().grid_map.frame_id, self.get_clock().now()
        message = Path(header=Header(stamp=now.to_msg(), frame_id=frame_id))
        if path is not None:
            for (x, y), z, yaw in zip(path.positions, path.heights, path.yaws, strict=True):
                stamped = PoseStamped(header=message.header)
                place, turn = stamped.pose.position, stamped.pose.orientation
                place.x, place.y, place.z = x, y, z
                turn.z, turn.w = math.sin(0.5 * yaw), math.cos(0.5 * yaw)
                message.poses.append(stamped)
        return message

    def _cost_to_go(self) -> bytes | None:
        """Return a map message with the costs to the end of the plan, or None without a plan."""
        planner = self._planner
        if planner is None or not len(self._plan):
            return None
        costs = planner.graph.cost_to(self._plan[-1]).costs
        return to_serialized_message(planner.grid_map.with_layers({"cost_to_go": costs}))

    def _make_plan(self, request: Any, response: Any) -> Any:
        with dropping(self._log, "make_plan"):
            start = request.start if request.start.header.frame_id else None
            response.plan = self._message(self._path(start, request.goal, request.tolerance))
        return response

    async def _execute(self, make_result: Callable[[], Any], handle: Any) -> Any:
        request, result, begin = handle.request, make_result(), time.monotonic()
        while not handle.is_cancel_requested:
            try:
                start = request.start if request.use_start else None
                path = self._path(start, request.goal, self._settings.tolerance)
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
            self._goal, self._failure = None, None
            result.path = self._send(path)
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
            poses = np.reshape([self._pose(pose) for pose in path.poses], (-1, 3))
            (blocked,) = planner.blocked(poses[:, :2]).nonzero()
            response.invalid_pose_indices = blocked.tolist()
            response.is_valid = len(poses) > 0 and not len(blocked)
        return response


if __name__ == "__main__":
    raise SystemExit(PathPlannerNode.main())
