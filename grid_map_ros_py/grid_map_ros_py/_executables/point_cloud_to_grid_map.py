# SPDX-License-Identifier: BSD-3-Clause
"""Node `point_cloud_to_grid_map`: fuses point clouds into a map that moves with the robot."""

import math
from functools import partial

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridGeometry
from grid_map_core_py.elevation import RollingMap
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import to_serialized_message
from .._mapping.pose_types import POSE_TYPES
from .._mapping.poses import PoseHistory, Poses, from_xyz_rpy
from .._mapping.scan_queue import RollingFusion, ScanQueue, read_cloud
from ..nodes import (
    ConfiguredNode,
    LogThrottle,
    TfPoses,
    dropping,
    has_tf,
    health_of,
    map_qos,
    read_parameter,
    steady_timer,
    warn_of_gaps,
)

POSE_SOURCES = ("auto", "tf", *POSE_TYPES, "none")
RELIABILITIES = {
    "best_effort": ReliabilityPolicy.BEST_EFFORT,
    "reliable": ReliabilityPolicy.RELIABLE,
}
POSE_QUEUE = 100
"""Depth of the pose subscription: poses arrive faster than clouds are fused."""

WAIT_PERIOD = 0.05
"""Time between two attempts to find the poses of waiting clouds [s]."""


class PointCloudToGridMapNode(ConfiguredNode):
    """Subscribes to clouds and poses, and publishes the fused map."""

    def __init__(self) -> None:
        super().__init__("point_cloud_to_grid_map")
        self._log = LogThrottle(self.get_logger())
        self._health = health_of(self)
        self._health.inputs = "clouds"
        self._has_news = False
        topic = self.read("input_topic", "/points", "topic of the clouds")
        output_topic = self.read("output_topic", "/grid_map", "topic of the map")
        about = (
            "`tf`, `odometry`, `pose`, `pose_with_covariance` or `none`; `auto` means `tf` where "
            "tf2 is installed, else `odometry`"
        )
        self._source = self.read_choice("pose_source", POSE_SOURCES, "auto", about)
        if self._source == "auto":
            self._source = "tf" if has_tf() else "odometry"
        self._clouds = self._read_clouds()
        self._publisher = self.create_publisher(GridMapMessage, output_topic, map_qos())
        about = "rate at which a changed map is published [Hz]; 0 means after every cloud"
        self._publish_rate = self.read_number("publish_rate", 0.0, 0.0, 1e9, about)
        if self._publish_rate > 0:
            steady_timer(self, 1 / self._publish_rate, self._publish)
        about = "time between two lines of statistics in the log [s]; 0 means none"
        if period := self.read_number("statistics_period", 0.0, 0.0, 1e9, about):
            steady_timer(self, period, lambda: self.get_logger().info(str(self._clouds.statistics)))
        steady_timer(self, WAIT_PERIOD, self._work)
        about = (
            "`best_effort` receives from every publisher; `reliable` requests lost clouds again, "
            "and receives from reliable publishers only"
        )
        reliability = self.read_choice("input_reliability", RELIABILITIES, "best_effort", about)
        qos = QoSProfile(depth=self._clouds.queue_size, reliability=RELIABILITIES[reliability])
        # Raw clouds are read without a copy.
        events = SubscriptionEventCallbacks(message_lost=warn_of_gaps(self, topic))
        clouds = self.create_subscription(
            PointCloud2, topic, self._on_cloud, qos, event_callbacks=events, raw=True
        )
        self.get_logger().info(f"maps the clouds of {clouds.topic_name}, poses: {self._source}")

    # --- parameters -------------------------------------------------------------------------------

    def _read_clouds(self) -> ScanQueue:
        map_frame = self.read("map_frame", "odom", "frame of the map")
        follow = self.read("robot_centric", True, "whether the map moves with the robot")
        has_poses = self._source != "none"
        check(has_poses or not follow, "robot_centric", "false without poses", follow)
        about = "side lengths of the map along x and y [m]"
        length = self._read_numbers("length", [10.0, 10.0], about)
        resolution = self.read("resolution", 0.1, "side of a cell [m]")
        position = self._read_numbers("position", [0.0, 0.0], "initial center of the map [m]")
        layer = self.read("layer", "elevation", "name of the layer of heights")
        about = "how clouds are combined: `max`, `min`, `mean` or `last`"
        fusion = self.read("fusion", "max", about)
        about = (
            "height of one cloud in a cell: `max`, `min`, `mean`, `median`, `first` or `last`; not "
            "used with the fusion `mean`"
        )
        reduction = self.read("reduction", "max", about)
        about = "for the fusion `mean`: largest weight of the past, in points; 0 means no limit"
        max_count = self.read("max_count", 0, about)
        low = self.read("min_height", -math.inf, "lower points are left out [m], map frame")
        high = self.read("max_height", math.inf, "higher points are left out [m], map frame")
        about = "additional fields of the clouds that become layers"
        fields = read_parameter(self, "fields", list[str], [], description=about)
        about = "points nearer to the sensor, the origin of their frame, are left out [m]"
        near = self.read("min_range", 0.0, about)
        far = self.read("max_range", math.inf, "points farther from the sensor are left out [m]")
        timeout = self.read("pose_timeout", 1.0, "maximum time a cloud waits for its pose [s]")
        about = "maximum number of clouds that wait for the node or for a pose"
        queue_size = self.read("queue_size", 10, about)
        geometry = GridGeometry(np.array(length), resolution, np.array(position))
        check_cells("length", geometry.size)
        rolling_map = RollingMap(
            geometry,
            map_frame,
            layer=layer,
            fusion=fusion,
            reduction=reduction,
            max_count=max_count,
            min_height=low,
            max_height=high,
        )
        self._map = rolling_map
        return ScanQueue(
            self._read_poses(map_frame),
            partial(read_cloud, fields=fields),
            RollingFusion(rolling_map, follow, near, far),
            self._drop,
            timeout=timeout,
            queue_size=queue_size,
        )

    def _read_poses(self, map_frame: str) -> Poses:
        """Return the source of poses; the parameters of all sources are declared."""
        about = "topic of the poses of the robot in the map frame; not used with tf"
        topic = self.read("pose_topic", "/odom", about)
        about = "frame that the map follows, with tf; empty means the frame of the cloud"
        robot_frame = self.read("robot_frame", "", about)
        about = "position of the sensor in the frame of the robot [m], without tf"
        xyz = self._read_numbers("sensor_xyz", [0.0, 0.0, 0.0], about)
        about = "roll, pitch and yaw of the sensor in that frame [rad], without tf"
        rpy = self._read_numbers("sensor_rpy", [0.0, 0.0, 0.0], about)
        if self._source == "none":
            return Poses(map_frame)
        if self._source == "tf":
            return TfPoses(self, map_frame, robot_frame)
        history = PoseHistory(map_frame, from_xyz_rpy(xyz, rpy))
        qos = QoSProfile(depth=POSE_QUEUE, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(
            POSE_TYPES[self._source], topic, lambda message: self._on_pose(history, message), qos
        )
        return history

    def _read_numbers(self, name: str, default: list[float], description: str) -> list[float]:
        """Return a parameter: a list of finite numbers, as long as the default."""
        value = read_parameter(self, name, list[float], default, description=description)
        fits = len(value) == len(default) and all(map(math.isfinite, value))
        check(fits, name, f"{len(default)} finite numbers", value)
        return value

    # --- messages ---------------------------------------------------------------------------------

    def _on_cloud(self, data: bytes) -> None:
        self._health.receive()
        self._note(self._clouds.add(data))

    def _drop(self, text: str) -> None:
        self._health.drop(text)
        self._log.error(text)

    def _on_pose(self, history: PoseHistory, message: Odometry | PoseStamped) -> None:
        with dropping(self._log, "dropped a pose"):
            history.add(message)
            self._work()

    def _work(self) -> None:
        self._note(self._clouds.work())

    def _note(self, has_changed: bool) -> None:
        self._has_news |= has_changed
        if has_changed:
            self._health.use(self._clouds.statistics.fused - self._health.used)
        if self._publish_rate == 0:
            self._publish()

    def _publish(self) -> None:
        if not self._has_news:
            return
        with dropping(self._log, "dropped a map"):
            self._publisher.publish(to_serialized_message(self._map.grid_map))
        self._has_news = False


if __name__ == "__main__":
    raise SystemExit(PointCloudToGridMapNode.main())
