# SPDX-License-Identifier: BSD-3-Clause
"""Node `elevation_mapping`: fuses range measurements into a map of heights and their variances.

Topics:
    ~/elevation_map_raw: the raw map, before the filter chain.
    ~/elevation_map: the filtered map, which is the result of the filter chain.

Services:
    ~/get_submap: `grid_map_msgs/GetGridMap`, returns the filtered map or a part of it.
    ~/get_raw_submap: `grid_map_msgs/GetGridMap`, returns the raw map or a part of it.
    ~/masked_replace: `grid_map_msgs/SetGridMap`, replaces the cells that a mask selects.
    ~/save_map, ~/load_map: `grid_map_msgs/ProcessFile`, save both maps, or load the raw map.
    ~/clear_map, ~/trigger_fusion, ~/disable_updates, ~/enable_updates: `std_srvs/Empty`.
    ~/reload_parameters: `std_srvs/Trigger`, applies changed parameters.

A failed request is logged and leaves the map unchanged.
"""

import math
import time
from collections.abc import Mapping
from functools import partial
from typing import Any

from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Empty, Trigger

from grid_map_msgs.srv import GetGridMap, ProcessFile, SetGridMap

from .._elevation_mapping.cameras import CameraImages
from .._elevation_mapping.outputs import MapOutputs
from .._elevation_mapping.services import MapServices
from .._elevation_mapping.settings import (
    Settings,
    read_chain,
    read_fusion,
    read_sources,
    read_unused,
)
from .._elevation_mapping.sources import InputSource
from ..nodes import ConfiguredNode
from ..nodes._health import LogThrottle, dropping, health_of
from ..nodes._parameters import read_fields
from ..nodes._poses import (
    POSE_QUEUE,
    POSE_TYPES,
    PoseHistory,
    Poses,
    TfPoses,
    chosen_source,
    from_xyz_rpy,
    subscribe_to_poses,
)
from ..nodes._scans import ScanInputs, ScanQueue, read_cloud
from ..nodes._topics import listen, offer_service

LOG_PERIOD = 5.0
"""Minimum time between two similar log messages [s]."""


class ElevationMappingNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__("elevation_mapping")
        self._log = LogThrottle(self.get_logger(), LOG_PERIOD)
        health = health_of(self)
        health.inputs, health.details = "scans", self._details
        sources = read_sources(self)
        self._settings = settings = read_fields(self, Settings)
        self._fusion = read_fusion(self, settings, sources)
        self._is_begun = not settings.initialize_elevation_map or settings.pose_source == "none"
        if unused := read_unused(self, sources):
            self.get_logger().warning(f"parameters without effect: {'; '.join(unused)}")
        chain = read_chain(self)
        self._outputs = MapOutputs(
            self,
            self._fusion,
            chain,
            self._log,
            raw_rate=settings.min_update_rate,
            filtered_rate=settings.fused_map_publishing_rate,
        )
        self._inputs = ScanInputs(self, self._log, None if self._is_begun else self._lay_patch)
        self._poses = self._make_poses()
        self._queues = {source.name: self._subscribe(source) for source in sources}
        services = MapServices(self, settings, self._fusion, self._outputs, self._inputs)
        for kind, action in (
            (GetGridMap, services.get_submap),
            (GetGridMap, services.get_raw_submap),
            (SetGridMap, services.masked_replace),
            (ProcessFile, services.save_map),
            (ProcessFile, services.load_map),
            (Empty, services.clear_map),
            (Empty, services.trigger_fusion),
            (Empty, services.disable_updates),
            (Empty, services.enable_updates),
            (Trigger, services.reload_parameters),
        ):
            offer_service(self, kind, action.__name__, action, self._log)
        topics = ", ".join(source.settings.topic for source in sources) or "nothing"
        poses = chosen_source(settings.pose_source, "topic")
        self.get_logger().info(f"maps {topics}, poses: {poses}")

    # --- sensors ----------------------------------------------------------------------------------

    def _make_poses(self) -> Poses:
        settings, frame = self._settings, self._settings.map_frame_id
        source = chosen_source(settings.pose_source, "topic")
        if source == "none":
            return Poses(frame)
        topic, point = settings.robot_pose_with_covariance_topic, settings.track_point
        history = PoseHistory(
            frame, None, settings.robot_pose_cache_size, point, with_covariances=True
        )
        if topic or source == "topic":
            kind = POSE_TYPES[settings.pose_type]
            work = self._inputs.work
            subscribe_to_poses(self, kind, topic or "/pose", history, work, self._log, POSE_QUEUE)
        if source == "topic":
            return history
        return TfPoses(
            self,
            frame,
            settings.robot_base_frame_id,
            track_frame=settings.track_point_frame_id,
            track_point=point,
            covariances=history if topic else None,
        )

    def _subscribe(self, source: InputSource) -> ScanQueue:
        """Subscribe to a source; return the queue of its scans."""
        given = source.settings
        fuse: Any = self._fusion.fuse
        read: Any = partial(read_cloud, fields=given.channels)
        if given.type != "pointcloud":
            images = CameraImages(given.stride)
            read = images.read_depths
            if given.type == "image":
                read, fuse = images.read_picture, self._fusion.paint
            info = source.camera_info_topic
            log = self._log
            images.topic = listen(self, CameraInfo, info, images.take, log, "a camera_info")
        poses, is_cloud = self._poses, given.type == "pointcloud"
        if isinstance(poses, PoseHistory):
            poses = poses.mounted(from_xyz_rpy(given.sensor_xyz, given.sensor_rpy))
        queue = ScanQueue(
            poses,
            read,
            partial(fuse, source),
            what=f"{'a cloud' if is_cloud else 'an image'} of {source.name}",
            timeout=self._settings.pose_timeout,
            queue_size=source.queue_size,
        )
        self._inputs.subscribe(
            PointCloud2 if is_cloud else Image,
            given.topic,
            queue,
            partial(self._outputs.on_scan, given.publish_on_update),
            name=source.name,
            is_reliable=given.reliability == "reliable",
        )
        return queue

    def _lay_patch(self) -> None:
        if self._is_begun:
            return
        with dropping(self._log, "initialize_elevation_map"):
            given = self._settings
            name = given.target_frame_init_submap or given.robot_base_frame_id
            frame = self._poses.frame_at(name, 0)
            if frame is not None:
                self._fusion.lay_patch(
                    frame,
                    (given.length_in_x_init_submap, given.length_in_y_init_submap),
                    given.init_submap_height_offset,
                    given.init_submap_variance,
                )
                self._is_begun = True
                self._outputs.publish_raw()

    def _details(self) -> dict[str, str]:
        fusion, found = self._fusion, dict[str, str]()
        age = math.nan if fusion.changed is None else time.monotonic() - fusion.changed
        found["seconds since the last change of the map"] = f"{age:.1f}"
        found["updates"] = "enabled" if self._inputs.is_enabled else "disabled"
        for name, queue in self._queues.items():
            scans = queue.statistics
            found[name] = f"{scans.fused} fused, {scans.dropped} dropped"
        if fusion.report is not None:
            for name, value in vars(fusion.report).items():
                if not isinstance(value, Mapping):
                    found[f"{name.replace('_', ' ')} in the last scan"] = f"{value:g}"
            for reason, count in fusion.report.reasons.items():
                found[f"points dropped in the last scan: {reason}"] = str(count)
        for stage, (last, mean) in fusion.milliseconds.items():
            found[f"ms {stage}"], found[f"mean ms {stage}"] = f"{last:.3f}", f"{mean:.3f}"
        return found


if __name__ == "__main__":
    raise SystemExit(ElevationMappingNode.main())
