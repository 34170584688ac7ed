# SPDX-License-Identifier: BSD-3-Clause
"""Node `large_map_robot`: odometry of a robot that drives along the path of `large_site`."""

import math

from nav_msgs.msg import Odometry
from std_msgs.msg import Header

from grid_map_ros_py import to_stamp
from grid_map_ros_py.nodes._spin import steady_timer

from .demo import Demo
from .large_site import END, way_at


class LargeMapRobotNode(Demo):
    """Node that publishes the odometry of the simulated robot."""

    def __init__(self) -> None:
        super().__init__("large_map_robot")
        self._speed = self.read_positive("speed", 150.0, "speed of the robot along x [m/s]")
        rate = self.read_positive("rate", 50.0, "odometry rate [Hz]")
        self._odometry = self.create_publisher(Odometry, "odom", 10)
        self._start = self.get_clock().now().nanoseconds
        steady_timer(self, 1 / rate, self._step)
        self.get_logger().info(f"drives at {self._speed:g} m/s")

    def _step(self) -> None:
        now = self.get_clock().now().nanoseconds
        message = Odometry(header=Header(stamp=to_stamp(now), frame_id="map"))
        message.child_frame_id = "base_link"
        place = message.pose.pose.position
        place.x, place.y = position_at(1e-9 * (now - self._start) * self._speed)
        message.pose.pose.orientation.w = 1.0
        self._odometry.publish(message)


def position_at(distance: float) -> tuple[float, float]:
    """Return x, y [m] of the robot after it has driven `distance` [m] along the x axis."""
    x = END - abs(math.remainder(distance, 4 * END))
    return x, float(way_at(x))


if __name__ == "__main__":
    raise SystemExit(LargeMapRobotNode.main())
