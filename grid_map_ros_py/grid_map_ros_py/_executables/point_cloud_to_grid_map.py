# SPDX-License-Identifier: BSD-3-Clause
"""Node `point_cloud_to_grid_map`: fuses point clouds into a map that moves with the robot."""

import math
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridGeometry
from grid_map_core_py.elevation import RollingMap
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import check

from .. import to_serialized_message
from ..nodes import ConfiguredNode, MapPublisher
from ..nodes._health import LogThrottle, health_of
from ..nodes._parameters import read_fields
from ..nodes._poses import (
    POSE_QUEUE,
    POSE_TYPES,
    Placement,
    PoseHistory,
    Poses,
    TfPoses,
    chosen_source,
    frame_name,
    from_xyz_rpy,
    subscribe_to_poses,
)
from ..nodes._scans import Cloud, ScanInputs, ScanQueue, read_cloud
from ..nodes._spin import steady_timer


@dataclass(frozen=True, kw_only=True)
class RollingSettings:
    """Parameters of the `point_cloud_to_grid_map` node.

    Attributes:
        input_topic: topic of the clouds.
        output_topic: topic of the map.
        pose_source: source of the poses; `auto` means `tf` if tf2 is installed, else `odometry`.
        map_frame: frame of the map.
        robot_centric: move the map with the robot.
        length: side lengths of the map along x and y [m].
        resolution: cell size [m].
        position: initial center of the map [m].
        layer: name of the height layer.
        fusion: how clouds are combined: `max`, `min`, `mean` or `last`.
        reduction: how the points of one cloud within a cell are combined: `max`, `min`, `mean`,
            `median`, `first` or `last`; unused with `mean` fusion.
        max_count: maximum weight of a cell's earlier points in `mean` fusion [points]. With a
            limit, the mean follows changes of the ground. 0 means no limit.
        min_height: height in the map frame below which points are ignored [m].
        max_height: height in the map frame above which points are ignored [m].
        fields: additional cloud fields that become layers.
        min_range: distance from the sensor below which points are ignored [m].
        max_range: distance from the sensor above which points are ignored [m].
        pose_timeout: maximum time a cloud waits for its pose [s].
        queue_size: maximum number of waiting clouds.
        pose_topic: topic of the robot poses in the map frame; unused with tf.
        robot_frame: frame that the map follows (tf only); empty means the cloud frame.
        sensor_xyz: position of the sensor on the robot [m]; unused with tf.
        sensor_rpy: roll, pitch and yaw of the sensor on the robot [rad]; unused with tf.
        publish_rate: rate at which a changed map is published [Hz]; 0 means after every cloud.
        statistics_period: interval between log messages with statistics [s]; 0 disables them.
        input_reliability: `best_effort` works with every publisher; `reliable` recovers lost
            clouds, but needs a reliable publisher.
    """

    input_topic: str = "/points"
    output_topic: str = "/grid_map"
    pose_source: Literal["auto", "tf", "odometry", "pose", "pose_with_covariance", "none"] = "auto"
    map_frame: str = "odom"
    robot_centric: bool = True
    length: list[float] = field(default_factory=lambda: [10.0, 10.0])
    resolution: float = 0.1
    position: list[float] = field(default_factory=lambda: [0.0, 0.0])
    layer: str = "elevation"
    fusion: str = "max"
    reduction: str = "max"
    max_count: int = 0
    min_height: float = -math.inf
    max_height: float = math.inf
    fields: list[str] = field(default_factory=list)
    min_range: float = 0.0
    max_range: float = math.inf
    pose_timeout: float = 1.0
    queue_size: int = 10
    pose_topic: str = "/odom"
    robot_frame: str = ""
    sensor_xyz: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    sensor_rpy: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    publish_rate: float = 0.0
    statistics_period: float = 0.0
    input_reliability: Literal["best_effort", "reliable"] = "best_effort"

    def __post_init__(self) -> None:
        has_center = self.pose_source != "none" or not self.robot_centric
        check(has_center, "robot_centric", "false without poses", True)
        for name, count in {"length": 2, "position": 2, "sensor_xyz": 3, "sensor_rpy": 3}.items():
            numbers = getattr(self, name)
            fits = len(numbers) == count and all(map(math.isfinite, numbers))
            check(fits, name, f"{count} finite numbers", numbers)
        is_range = 0 <= self.min_range < self.max_range
        check(is_range, "min_range", "at least 0 and below max_range", self.min_range)
        for name in ("publish_rate", "statistics_period"):
            value = getattr(self, name)
            fits = value == 0 or 1e-9 <= value <= 1e9
            check(fits, name, "0, or a number from 1e-09 to 1e+09", value)


class PointCloudToGridMapNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__("point_cloud_to_grid_map")
        settings, log = read_fields(self, RollingSettings), LogThrottle(self.get_logger())
        health_of(self).inputs = "clouds"
        geometry = GridGeometry(settings.length, settings.resolution, settings.position)
        check_cells("length", geometry.size)
        rolling_map = RollingMap(
            geometry,
            frame_name(settings.map_frame),
            layer=settings.layer,
            fusion=settings.fusion,
            reduction=settings.reduction,
            max_count=settings.max_count,
            min_height=settings.min_height,
            max_height=settings.max_height,
        )
        source, inputs = chosen_source(settings.pose_source, "odometry"), ScanInputs(self, log)
        poses = Poses(settings.map_frame)
        if source == "tf":
            poses = TfPoses(self, settings.map_frame, settings.robot_frame)
        elif source != "none":
            mount = from_xyz_rpy(settings.sensor_xyz, settings.sensor_rpy)
            poses = PoseHistory(settings.map_frame, mount)
            kind, topic = POSE_TYPES[source], settings.pose_topic
            subscribe_to_poses(self, kind, topic, poses, inputs.work, log, POSE_QUEUE)

        def fuse(scan: Cloud, placement: Placement) -> dict[str, int]:
            return rolling_map.fuse(
                scan.points,
                scan.columns,
                transform=placement.transform,
                min_range=settings.min_range,
                max_range=settings.max_range,
                position=placement.center if settings.robot_centric else None,
                timestamp=scan.stamp,
            )

        clouds = ScanQueue(
            poses,
            partial(read_cloud, fields=settings.fields),
            fuse,
            timeout=settings.pose_timeout,
            queue_size=settings.queue_size,
        )

        def serialized() -> bytes | None:
            has_map = clouds.statistics.fused > 0
            return to_serialized_message(rolling_map.grid_map) if has_map else None

        publisher = MapPublisher(self, settings.output_topic, serialized, log)

        def publish() -> None:
            publisher.publish_version(clouds.statistics.fused)

        rate, period = settings.publish_rate, settings.statistics_period
        if rate:
            steady_timer(self, 1 / rate, publish)
        if period:
            steady_timer(self, period, lambda: self.get_logger().info(str(clouds.statistics)))
        topic = inputs.subscribe(
            PointCloud2,
            settings.input_topic,
            clouds,
            publish if not rate else lambda: None,
            is_reliable=settings.input_reliability == "reliable",
        )
        self.get_logger().info(f"maps the clouds of {topic}, poses: {source}")


if __name__ == "__main__":
    raise SystemExit(PointCloudToGridMapNode.main())
