# SPDX-License-Identifier: BSD-3-Clause
"""Node `planar_regions_robot`: a depth camera that moves over stairs, a ramp and stepping stones.

The node publishes the point clouds of the camera, the odometry and the true terrain. The camera
starts to move when another node subscribes to the clouds. It stops at the stepping stones.
"""

import numpy as np
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from grid_map_core_py.simulation import scan
from grid_map_ros_py import to_pose, to_serialized_message, to_stamp
from grid_map_ros_py.nodes._spin import steady_timer

from .demo import Demo
from .sensing_robot import to_cloud
from .steps_course import BEAMS, END, MAX_RANGE, NOISE, make_course, pose_at


class PlanarRegionsRobotNode(Demo):
    """Moves the camera and publishes what it measures."""

    def __init__(self) -> None:
        super().__init__("planar_regions_robot")
        speed = self.read_positive("speed", 0.6, "speed of the camera [m/s]")
        period = 1.0 / self.read_positive("rate", 5.0, "rate of the scans [Hz]")
        self._random = np.random.default_rng(self.read("seed", 1, "seed of the noise"))
        self._course, self._x, self._step_length = make_course(), 0.0, speed * period
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self._cloud = self.create_publisher(PointCloud2, "camera_points", 5)
        self._truth = self.map_publisher("true_terrain")
        self._truth.publish(to_serialized_message(self._course))
        steady_timer(self, period, self._step)
        self.get_logger().info(f"moves at {speed:g} m/s over {self._course}")

    def _step(self) -> None:
        # The mapping node may have to compile first.
        if self._cloud.get_subscription_count():
            self._x = min(self._x + self._step_length, END)
        pose, now = pose_at(self._x), self.get_clock().now().nanoseconds
        odometry = Odometry(header=Header(stamp=to_stamp(now), frame_id="odom"))
        odometry.child_frame_id = "camera"
        odometry.pose.pose = to_pose(pose)
        points = scan(
            self._course, BEAMS, pose, sensor=NOISE, random=self._random, max_range=MAX_RANGE
        )
        # Together, because the first scan takes longer than the start of a subscriber.
        self._odometry.publish(odometry)
        self._cloud.publish(to_cloud(points, now, "camera"))


if __name__ == "__main__":
    raise SystemExit(PlanarRegionsRobotNode.main())
