# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `point_cloud_to_grid_map`: fuses point clouds into a map that moves with the robot."""

import math
from collections.abc import Collection
from typing import TypeVar

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridGeometry
from grid_map_core_py.elevation import RollingMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import to_serialized_message
from .._mapping.cloud_mapper import CloudMapper
from .._mapping.poses import PoseHistory, Poses, from_xyz_rpy
from ..nodes import (
    LogThrottle,
    TfPoses,
    has_tf,
    map_qos,
    read_parameter,
    run,
    steady_timer,
    warn_of_gaps,
)

T = TypeVar("T")

POSE_TYPES = {
    "odometry": Odometry,
    "pose": PoseStamped,
    "pose_with_covariance": PoseWithCovarianceStamped,
}
POSE_SOURCES = ("auto", "tf", *POSE_TYPES, "none")
RELIABILITIES = {
    "best_effort": ReliabilityPolicy.BEST_EFFORT,
    "reliable": ReliabilityPolicy.RELIABLE,
}
DESCRIPTIONS = {
    "input_topic": "topic of the clouds",
    "output_topic": "topic of the map",
    "input_reliability": (
        "`best_effort` receives from every publisher; `reliable` requests lost clouds again, and "
        "receives from reliable publishers only"
    ),
    "queue_size": "maximum number of clouds that wait for the node or for a pose",
    "publish_rate": "rate at which a changed map is published [Hz]; 0 means after every cloud",
    "map_frame": "frame of the map",
    "resolution": "side of a cell [m]",
    "length": "side lengths of the map along x and y [m]",
    "position": "initial center of the map [m]",
    "robot_centric": "whether the map moves with the robot",
    "pose_source": (
        "`tf`, `odometry`, `pose`, `pose_with_covariance` or `none`; `auto` means `tf` where"
        " tf2 is installed, else `odometry`"
    ),
    "pose_topic": "topic of the poses of the robot in the map frame; not used with tf",
    "pose_timeout": "maximum time a cloud waits for its pose [s]",
    "robot_frame": "frame that the map follows, with tf; empty means the frame of the cloud",
    "sensor_xyz": "position of the sensor in the frame of the robot [m], without tf",
    "sensor_rpy": "roll, pitch and yaw of the sensor in that frame [rad], without tf",
    "layer": "name of the layer of heights",
    "fusion": "how clouds are combined: `max`, `min`, `mean` or `last`",
    "reduction": (
        "height of one cloud in a cell: `max`, `min`, `mean`, `median`, `first` or `last`; not "
        "used with the fusion `mean`"
    ),
    "max_count": "for the fusion `mean`: largest weight of the past, in points; 0 means no limit",
    "fields": "additional fields of the clouds that become layers",
    "min_height": "lower points are left out [m], map frame",
    "max_height": "higher points are left out [m], map frame",
    "min_range": "points nearer to the sensor, the origin of their frame, are left out [m]",
    "max_range": "points farther from the sensor are left out [m]",
    "statistics_period": "time between two lines of statistics in the log [s]; 0 means none",
}
"""Descriptions of the parameters, as `ros2 param describe` shows them."""

POSE_QUEUE = 100
"""Depth of the pose subscription: poses arrive faster than clouds are fused."""

WAIT_PERIOD = 0.05
"""Time between two attempts to find the poses of waiting clouds [s]."""


class PointCloudToGridMapNode(Node):
    """Subscribes to clouds and poses, and publishes the fused map."""

    def __init__(self) -> None:
        super().__init__("point_cloud_to_grid_map")
        self._report = LogThrottle(self.get_logger()).error
        self._has_news = False
        topic = _read(self, "input_topic", str, "/points")
        output_topic = _read(self, "output_topic", str, "/grid_map")
        self._source = _read_choice(self, "pose_source", "auto", POSE_SOURCES)
        if self._source == "auto":
            self._source = "tf" if has_tf() else "odometry"
        self._mapper = self._read_mapper()
        self._publisher = self.create_publisher(GridMapMessage, output_topic, map_qos())
        self._publish_rate = _read_not_negative(self, "publish_rate", 0.0)
        if self._publish_rate > 0:
            steady_timer(self, 1 / self._publish_rate, self._publish)
        if period := _read_not_negative(self, "statistics_period", 0.0):
            steady_timer(self, period, self._log_statistics)
        steady_timer(self, WAIT_PERIOD, self._work)
        reliability = _read_choice(self, "input_reliability", "best_effort", RELIABILITIES)
        qos = QoSProfile(depth=self._mapper.queue_size, reliability=RELIABILITIES[reliability])
        # Raw clouds are read without a copy.
        events = SubscriptionEventCallbacks(message_lost=warn_of_gaps(self, topic))
        clouds = self.create_subscription(
            PointCloud2, topic, self._on_cloud, qos, event_callbacks=events, raw=True
        )
        self.get_logger().info(f"maps the clouds of {clouds.topic_name}, poses: {self._source}")

    # --- parameters -------------------------------------------------------------------------------

    def _read_mapper(self) -> CloudMapper:
        map_frame = _read(self, "map_frame", str, "odom")
        follow = _read(self, "robot_centric", bool, True)
        has_poses = self._source != "none"
        check(has_poses or not follow, "robot_centric", "false without poses", follow)
        geometry = GridGeometry(
            np.array(_read_numbers(self, "length", [10.0, 10.0])),
            _read(self, "resolution", float, 0.1),
            np.array(_read_numbers(self, "position", [0.0, 0.0])),
        )
        rolling_map = RollingMap(
            geometry,
            map_frame,
            layer=_read(self, "layer", str, "elevation"),
            fusion=_read(self, "fusion", str, "max"),
            reduction=_read(self, "reduction", str, "max"),
            max_count=_read(self, "max_count", int, 0),
            min_height=_read(self, "min_height", float, -math.inf),
            max_height=_read(self, "max_height", float, math.inf),
        )
        return CloudMapper(
            rolling_map,
            self._read_poses(map_frame),
            self._report,
            fields=_read(self, "fields", list[str], []),
            follow=follow,
            min_range=_read(self, "min_range", float, 0.0),
            max_range=_read(self, "max_range", float, math.inf),
            timeout=_read(self, "pose_timeout", float, 1.0),
            queue_size=_read(self, "queue_size", int, 10),
        )

    def _read_poses(self, map_frame: str) -> Poses:
        """Return the source of poses; the parameters of all sources are declared."""
        topic = _read(self, "pose_topic", str, "/odom")
        robot_frame = _read(self, "robot_frame", str, "")
        xyz = _read_numbers(self, "sensor_xyz", [0.0, 0.0, 0.0])
        rpy = _read_numbers(self, "sensor_rpy", [0.0, 0.0, 0.0])
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

    # --- messages ---------------------------------------------------------------------------------

    def _on_cloud(self, data: bytes) -> None:
        self._note(self._mapper.add(data))

    def _on_pose(self, history: PoseHistory, message: Odometry | PoseStamped) -> None:
        try:
            history.add(message)
        except GridMapError as error:
            self._report(f"dropped a pose: {error}")
        else:
            self._work()

    def _work(self) -> None:
        self._note(self._mapper.work())

    def _note(self, has_changed: bool) -> None:
        self._has_news |= has_changed
        if self._publish_rate == 0:
            self._publish()

    def _publish(self) -> None:
        if self._has_news:
            self._publisher.publish(to_serialized_message(self._mapper.rolling_map.grid_map))
            self._has_news = False

    def _log_statistics(self) -> None:
        self.get_logger().info(str(self._mapper.statistics))


def _read(node: Node, name: str, kind: type[T], default: T) -> T:
    return read_parameter(node, name, kind, default, description=DESCRIPTIONS[name])


def _read_choice(node: Node, name: str, default: str, known: Collection[str]) -> str:
    value = _read(node, name, str, default)
    check(value in known, name, f"one of {', '.join(known)}", value)
    return value


def _read_not_negative(node: Node, name: str, default: float) -> float:
    value = _read(node, name, float, default)
    check(math.isfinite(value) and value >= 0, name, "a finite number, 0 or more", value)
    return value


def _read_numbers(node: Node, name: str, default: list[float]) -> list[float]:
    """Return a parameter: a list of finite numbers, as long as the default."""
    value = _read(node, name, list[float], default)
    fits = len(value) == len(default) and all(map(math.isfinite, value))
    check(fits, name, f"{len(default)} finite numbers", value)
    return value


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(PointCloudToGridMapNode)


if __name__ == "__main__":
    raise SystemExit(main())
