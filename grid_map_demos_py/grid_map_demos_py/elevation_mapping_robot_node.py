# SPDX-License-Identifier: BSD-3-Clause
"""Node `elevation_mapping_robot`: a simulated robot with a lidar and a depth camera.

The robot drives on real terrain with boxes, a ramp and stairs. A person crosses the path. The robot
starts when a node subscribes to the lidar. The node publishes the clouds of both sensors, drifting
odometry with covariance, and the true terrain around the robot in the odometry frame.
"""

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from grid_map_core_py.simulation import scan
from grid_map_ros_py import to_pose, to_serialized_message, to_stamp
from grid_map_ros_py.messages._point_cloud import write_points
from grid_map_ros_py.nodes._spin import steady_timer

from .demo import Demo
from .robot_course import (
    SENSORS,
    RobotCourse,
    covariance_at,
    drifted,
    load_course,
    to_bytes,
    truth_at,
)

TRUTH_LENGTH = 12.0
"""Side length of the published section of the true terrain [m]."""

MAX_RANGE = 20.0


class ElevationMappingRobotNode(Demo):
    """Node that moves the robot, simulates both sensors and publishes the measurements."""

    def __init__(self) -> None:
        super().__init__("elevation_mapping_robot")
        about = "elevation model (.npz file); if empty, the model in this package"
        path = self.read_path("file", "", about, data="jacksboro_fault_dem.npz")
        speed = self.read_positive("speed", 0.6, "speed of the robot [m/s]")
        rate = self.read_positive("rate", 10.0, "scan rate of each sensor [Hz]")
        seed = self.read("seed", 1, "seed of the noise")
        self._course = RobotCourse(load_course(path), speed)
        self._random = np.random.default_rng(seed)
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self._clouds: dict[str, Publisher] = {
            name: self.create_publisher(PointCloud2, f"{name}_points", 5) for name in SENSORS
        }
        self._truth = self.map_publisher("true_terrain")
        self._start = self.get_clock().now().nanoseconds
        steady_timer(self, 1.0 / rate, self._step)
        self.get_logger().info(f"drives at {speed:g} m/s on {self._course.ground}")

    def _step(self) -> None:
        now = self.get_clock().now().nanoseconds
        # Wait for a subscriber: the mapping node may have to compile first.
        self._start = self._start if self._clouds["lidar"].get_subscription_count() else now
        seconds = 1e-9 * (now - self._start)
        pose = self._course.pose_at(seconds)
        odometry = Odometry(header=Header(stamp=to_stamp(now), frame_id="odom"))
        odometry.child_frame_id = "base_link"
        odometry.pose.pose = to_pose(drifted(pose, seconds))
        odometry.pose.covariance = covariance_at(seconds).ravel()
        self._odometry.publish(odometry)
        terrain = self._course.terrain_at(seconds)
        for name, (mount, directions, noise) in SENSORS.items():
            points = scan(
                terrain,
                directions,
                pose @ mount,
                sensor=noise,
                random=self._random,
                max_range=MAX_RANGE,
            )
            header = Header(stamp=to_stamp(now), frame_id=name)
            returned = points[np.isfinite(points[:, 0])]
            self._clouds[name].publish(write_points("xyz", to_bytes(returned), header))
        truth = truth_at(terrain, pose[:2, 3], TRUTH_LENGTH, seconds)
        truth.frame_id, truth.timestamp = "odom", now
        self._truth.publish(to_serialized_message(truth))


if __name__ == "__main__":
    raise SystemExit(ElevationMappingRobotNode.main())
