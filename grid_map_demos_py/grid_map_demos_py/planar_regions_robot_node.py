# SPDX-License-Identifier: BSD-3-Clause
"""Node `planar_regions_robot`: a depth camera that moves over stairs, a ramp and stepping stones.

The node publishes the clouds of the camera, its odometry and the true terrain. The camera starts
when a node subscribes to the clouds, and stops at the stones.
"""

import math

import numpy as np
from nav_msgs.msg import Odometry
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from grid_map_core_py import GridMap
from grid_map_core_py.elevation import StructuredLightModel
from grid_map_core_py.simulation import DepthCamera, scan, with_box, with_ramp, with_stairs
from grid_map_ros_py import to_pose, to_serialized_message, to_stamp
from grid_map_ros_py.messages._point_cloud import write_points
from grid_map_ros_py.nodes._spin import steady_timer

from .demo import Demo
from .elevation_mapping_robot_node import to_bytes
from .robot_course import Matrix

RISER, TREAD, STEPS, WIDTH = 0.17, 0.3, 5, 1.6
"""Height and depth of a step [m], number of steps, and width of stairs and ramp [m]."""

LANDING, RAMP = 0.8, 2.2
"""Lengths of the landing above the stairs, and of the ramp behind it [m]."""

FIRST, END = 1.0, 6.5
"""x of the first riser and of the last pose of the camera [m]; the first pose is at x = 0."""

TOP, FOOT = STEPS * RISER, FIRST + STEPS * TREAD + LANDING + RAMP
"""Height of the landing, and x of the foot of the ramp [m]."""

PLANES = {
    "treads": [(FIRST + (step + 0.5) * TREAD, 0.0) for step in range(STEPS)],
    "ramp": [(FOOT - 0.5 * RAMP, 0.0)],
    "stones": [(FOOT + 0.5 + 0.48 * k, 0.48 * side) for k in range(3) for side in (-1, 0, 1)],
}
"""Centers of the planes [m]; the highest tread is a part of the landing."""

NOISE, BEAMS, MAX_RANGE = StructuredLightModel(), DepthCamera(width=212, height=120).directions, 6.0


def make_course() -> GridMap:
    """Return stairs, landing, ramp and stones on a floor, with cells of 2 cm."""
    course = GridMap((10.0, 4.0), 0.02, (4.0, 0.0), layers={"elevation": 0.0}, frame_id="odom")
    depth, top = STEPS * TREAD, FIRST + STEPS * TREAD
    course = with_stairs(course, (top - 0.5 * depth, 0.0), (depth, WIDTH), TOP, STEPS)
    course = with_box(course, (top + 0.5 * LANDING, 0.0), (LANDING, WIDTH), TOP)
    course = with_ramp(course, *PLANES["ramp"], (RAMP, WIDTH), TOP, yaw=math.pi)
    for number, center in enumerate(PLANES["stones"]):
        course = with_box(course, center, (0.32, 0.32), 0.1 + 0.05 * (number % 4))
    return course


def pose_at(x: float) -> Matrix:
    """Return the pose (4, 4) of the camera, which looks 60 degrees down from 2.2 m."""
    tilt = math.radians(60.0)
    pose = np.eye(4)
    pose[:3, 0] = 0.0, -1.0, 0.0
    pose[:3, 1] = -math.sin(tilt), 0.0, -math.cos(tilt)
    pose[:3, 2] = math.cos(tilt), 0.0, -math.sin(tilt)
    pose[:3, 3] = x, 0.0, 2.2
    return pose


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
        pose, stamp = pose_at(self._x), to_stamp(self.get_clock().now().nanoseconds)
        odometry = Odometry(header=Header(stamp=stamp, frame_id="odom"), child_frame_id="camera")
        odometry.pose.pose = to_pose(pose)
        self._odometry.publish(odometry)
        options = {"sensor": NOISE, "random": self._random, "max_range": MAX_RANGE}
        points = scan(self._course, BEAMS, pose, **options)
        header = Header(stamp=stamp, frame_id="camera")
        returned = points[np.isfinite(points[:, 0])]
        self._cloud.publish(write_points("xyz", to_bytes(returned), header))


if __name__ == "__main__":
    raise SystemExit(PlanarRegionsRobotNode.main())
