# SPDX-License-Identifier: BSD-3-Clause
"""Base class of the nodes that simulate a robot with a lidar and a depth camera."""

import array

import numpy as np
from nav_msgs.msg import Odometry
from rclpy.publisher import Publisher
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Positions
from grid_map_core_py.simulation import scan
from grid_map_ros_py import to_pose, to_serialized_message, to_stamp
from grid_map_ros_py.messages._point_cloud import write_points
from grid_map_ros_py.nodes._spin import steady_timer

from .demo import Demo
from .robot_course import SENSORS, Matrix


class SensingRobot(Demo):
    """Node that publishes odometry, the clouds of both sensors, and the true terrain.

    `speed` [m/s] and `rate` [Hz] are parameter defaults. `max_range` is the sensor range [m].
    """

    def __init__(self, name: str, *, speed: float, rate: float, max_range: float) -> None:
        super().__init__(name)
        about = "elevation model (.npz file); if empty, the model of the Jacksboro fault"
        self.model = self.read_path("file", "", about, data="jacksboro_fault_dem.npz")
        self.speed = self.read_positive("speed", speed, "speed of the robot [m/s]")
        self.period = 1.0 / self.read_positive("rate", rate, "scan rate of each sensor [Hz]")
        self._random = np.random.default_rng(self.read("seed", 1, "seed of the noise"))
        self._max_range = max_range
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self._clouds: dict[str, Publisher] = {
            name: self.create_publisher(PointCloud2, f"{name}_points", 5) for name in SENSORS
        }
        self._truth = self.map_publisher("true_terrain")
        steady_timer(self, self.period, self.step)

    def step(self) -> None:
        """Move the robot and publish its measurements; called once per `period`."""
        raise NotImplementedError

    @property
    def is_heard(self) -> bool:
        """True if a node subscribes to the lidar."""
        return self._clouds["lidar"].get_subscription_count() > 0

    def publish_truth(self, terrain: GridMap, stamp: int) -> None:
        terrain.frame_id, terrain.timestamp = "odom", stamp
        self._truth.publish(to_serialized_message(terrain))

    def publish_measurements(
        self, terrain: GridMap, pose: Matrix, stamp: int, reported: Matrix, covariance: Matrix
    ) -> Odometry:
        """Publish `reported` and `covariance` as odometry, and scan the terrain from `pose`."""
        odometry = Odometry(header=Header(stamp=to_stamp(stamp), frame_id="odom"))
        odometry.child_frame_id = "base_link"
        odometry.pose.pose = to_pose(reported)
        odometry.pose.covariance = covariance.ravel()
        clouds = {}
        for name, (mount, directions, noise) in SENSORS.items():
            points = scan(
                terrain,
                directions,
                pose @ mount,
                sensor=noise,
                random=self._random,
                max_range=self._max_range,
            )
            clouds[name] = to_cloud(points, stamp, name)
        # Together, because the first scan takes longer than the start of a subscriber.
        self._odometry.publish(odometry)
        for name, cloud in clouds.items():
            self._clouds[name].publish(cloud)
        return odometry


def to_cloud(points: Positions, stamp: int, frame_id: str) -> PointCloud2:
    """Convert points (N, 3) to a cloud message without NaN points; `stamp` is in ns."""
    returned = points[np.isfinite(points[:, 0])].astype("<f4")
    header = Header(stamp=to_stamp(stamp), frame_id=frame_id)
    return write_points("xyz", array.array("B", returned.tobytes()), header)
