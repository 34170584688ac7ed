# SPDX-License-Identifier: BSD-3-Clause
"""Node `path_planner_robot`: a simulated robot that walks along the plans of `path_planner`.

The robot has the sensors of `elevation_mapping_robot`. It publishes their clouds, its odometry
without drift, the true terrain and a goal, and walks once a plan arrives.
"""

import math

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path
from rclpy.publisher import Publisher
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from grid_map_core_py.simulation import scan
from grid_map_ros_py import ReceivedMap, to_pose, to_serialized_message, to_stamp
from grid_map_ros_py.messages._point_cloud import write_points
from grid_map_ros_py.nodes import MapSubscription, map_qos
from grid_map_ros_py.nodes._spin import steady_timer

from .demo import Demo
from .robot_course import (
    ARRIVED,
    GOAL,
    SENSORS,
    START,
    Walker,
    load_course,
    standing_pose,
    to_bytes,
)

MAX_RANGE = 12.0
"""Range of the sensors [m]."""

MAP = "/elevation_mapping/elevation_map"
"""Topic of the maps for the planner."""


class PathPlannerRobotNode(Demo):
    """Walks along plans, simulates both sensors and publishes the measurements."""

    def __init__(self) -> None:
        super().__init__("path_planner_robot")
        about = "elevation model (.npz file); if empty, the model in this package"
        path = self.read_path("file", "", about, data="jacksboro_fault_dem.npz")
        self._speed = self.read_positive("speed", 0.8, "speed of the robot [m/s]")
        self._period = 1.0 / self.read_positive("rate", 5.0, "scan rate of each sensor [Hz]")
        self._random = np.random.default_rng(self.read("seed", 1, "seed of the noise"))
        self._ground = load_course(path)
        # Walls at the borders keep the robot on the terrain.
        inner = np.pad(np.zeros(np.subtract(self._ground.size, 20)), 10, constant_values=1.5)
        self._ground["elevation"] += inner.astype(np.float32)
        self._walker, self._is_done = Walker(START, GOAL), False
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self._goal = self.create_publisher(PoseStamped, "goal_pose", map_qos())
        self._clouds: dict[str, Publisher] = {
            name: self.create_publisher(PointCloud2, f"{name}_points", 5) for name in SENSORS
        }
        truth = self._ground.copy()
        truth.frame_id = "odom"
        self._truth = self.map_publisher("true_terrain")
        self._truth.publish(to_serialized_message(truth))
        self.create_subscription(Path, "plan", self._on_plan, map_qos())
        steady_timer(self, self._period, self._step)
        # The planner needs a map first.
        self._maps = MapSubscription(self, MAP, self._ask)
        self.get_logger().info(f"walks at {self._speed:g} m/s on {self._ground}")

    def _ask(self, _: ReceivedMap) -> None:
        """Publish the goal, and ignore later maps."""
        self._maps.destroy()
        goal = PoseStamped(header=Header(frame_id="odom"))
        goal.pose.position.x, goal.pose.position.y = GOAL
        self._goal.publish(goal)

    def _on_plan(self, message: Path) -> None:
        places = [pose.pose.position for pose in message.poses]
        self._walker.follow(np.array([(place.x, place.y) for place in places]).reshape(-1, 2))

    def _step(self) -> None:
        self._walker.walk(self._speed * self._period)
        if not self._is_done and math.dist(self._walker.position, GOAL) < ARRIVED:
            self._is_done = True
            self.get_logger().info("reached the goal")
        pose = standing_pose(self._ground, self._walker.position, self._walker.way)
        now = self.get_clock().now().nanoseconds
        odometry = Odometry(header=Header(stamp=to_stamp(now), frame_id="odom"))
        odometry.child_frame_id = "base_link"
        odometry.pose.pose = to_pose(pose)
        self._odometry.publish(odometry)
        for name, (mount, directions, noise) in SENSORS.items():
            points = scan(
                self._ground,
                directions,
                pose @ mount,
                sensor=noise,
                random=self._random,
                max_range=MAX_RANGE,
            )
            self._clouds[name].publish(_cloud(points, Header(stamp=to_stamp(now), frame_id=name)))


def _cloud(points: npt.NDArray[np.float64], header: Header) -> PointCloud2:
    """Return a cloud of the points (N, 3) that are not NaN."""
    return write_points("xyz", to_bytes(points[np.isfinite(points[:, 0])]), header)


if __name__ == "__main__":
    raise SystemExit(PathPlannerRobotNode.main())
