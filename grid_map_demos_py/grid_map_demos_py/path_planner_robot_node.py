# SPDX-License-Identifier: BSD-3-Clause
"""Node `path_planner_robot`: a simulated robot that walks along the plans of `path_planner`.

The robot has the sensors of `elevation_mapping_robot`, with a shorter range, and odometry without
drift. After each map, the robot walks only a limited distance. It therefore never walks onto
unchecked ground if a map is late.
"""

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Path

from grid_map_ros_py import ReceivedMap, from_pose
from grid_map_ros_py.nodes import MapSubscription, map_qos

from .robot_course import GOAL, MAX_RANGE, START, STRIDE, Walker, load_cliff, standing_pose
from .sensing_robot import SensingRobot

MAP = "/elevation_mapping/elevation_map"  # topic of the maps for the planner


class PathPlannerRobotNode(SensingRobot):
    """Walks along plans as far as the latest map allows."""

    def __init__(self) -> None:
        super().__init__("path_planner_robot", speed=0.8, rate=5.0, max_range=MAX_RANGE)
        self._ground = load_cliff(self.model)
        self._walker, self._stride = Walker(), 0.0
        self.publish_truth(self._ground.copy(), self.get_clock().now().nanoseconds)
        self._pose = self.create_publisher(PoseWithCovarianceStamped, "initial_pose", map_qos())
        self._goal = self.create_publisher(PoseStamped, "goal_pose", map_qos())
        self.create_subscription(Path, "plan", self._on_plan, map_qos())
        self._maps = MapSubscription(self, MAP, self._on_map)
        self.get_logger().info(f"walks at {self.speed:g} m/s on {self._ground}")

    def _on_map(self, _: ReceivedMap) -> None:
        self._stride = STRIDE
        if np.array_equal(self._walker.position, START):
            goal = PoseStamped()
            goal.header.frame_id = "odom"
            goal.pose.position.x, goal.pose.position.y = GOAL
            self._goal.publish(goal)

    def _on_plan(self, message: Path) -> None:
        places = [from_pose(pose)[:2, 3] for pose in message.poses]
        self._walker.follow(np.reshape(places, (-1, 2)))

    def step(self) -> None:
        if len(self._walker.plan):
            distance = min(self.speed * self.period, self._stride)
            self._stride -= distance
            self._walker.walk(distance)
        pose = standing_pose(self._ground, self._walker.position, self._walker.way)
        now = self.get_clock().now().nanoseconds
        odometry = self.publish_measurements(self._ground, pose, now, pose, np.zeros((6, 6)))
        message = PoseWithCovarianceStamped(header=odometry.header, pose=odometry.pose)
        self._pose.publish(message)


if __name__ == "__main__":
    raise SystemExit(PathPlannerRobotNode.main())
