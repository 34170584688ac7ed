# SPDX-License-Identifier: BSD-3-Clause
"""Node `elevation_mapping_robot`: a simulated robot with a lidar and a depth camera.

The robot drives on real terrain with boxes, a ramp and stairs. A person crosses its path. The robot
starts when another node subscribes to the lidar. The node publishes the point clouds of both
sensors, drifting odometry, and the true terrain around the robot.
"""

from .robot_course import RobotCourse, covariance_at, drifted, load_course, truth_at
from .sensing_robot import SensingRobot

TRUTH_LENGTH = 12.0  # side length of the published section of the true terrain [m]


class ElevationMappingRobotNode(SensingRobot):
    """Moves the robot along its course."""

    def __init__(self) -> None:
        super().__init__("elevation_mapping_robot", speed=0.6, rate=10.0, max_range=20.0)
        self._course = RobotCourse(load_course(self.model), self.speed)
        self._start = self.get_clock().now().nanoseconds
        self.get_logger().info(f"drives at {self.speed:g} m/s on {self._course.ground}")

    def step(self) -> None:
        now = self.get_clock().now().nanoseconds
        # Wait for a subscriber, because the mapping node may have to compile code first.
        self._start = self._start if self.is_heard else now
        seconds = 1e-9 * (now - self._start)
        pose, terrain = self._course.pose_at(seconds), self._course.terrain_at(seconds)
        covariance = covariance_at(seconds)
        self.publish_measurements(terrain, pose, now, drifted(pose, seconds), covariance)
        self.publish_truth(truth_at(terrain, pose[:2, 3], TRUTH_LENGTH, seconds), now)


if __name__ == "__main__":
    raise SystemExit(ElevationMappingRobotNode.main())
