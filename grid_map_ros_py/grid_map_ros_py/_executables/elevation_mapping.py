# SPDX-License-Identifier: BSD-3-Clause
"""Node `elevation_mapping`: fuses range sensors into a map of heights with variances.

Topics: `~/elevation_map_raw`, and `~/elevation_map` after the filters of the pipeline.

Services:
    ~/get_submap, ~/get_raw_submap: `grid_map_msgs/GetGridMap`, a map or a part of it.
    ~/masked_replace: `grid_map_msgs/SetGridMap`, replaces cells.
    ~/save_map, ~/load_map: `grid_map_msgs/ProcessFile`, both maps in a bag.
    ~/clear_map, ~/trigger_fusion, ~/disable_updates, ~/enable_updates: `std_srvs/Empty`.
    ~/reload_parameters: `std_srvs/Trigger`, takes over parameters that were set.

A request that fails is logged and changes nothing.
"""

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Empty, Trigger

from grid_map_core_py import GridMap
from grid_map_core_py.elevation import ElevationMapper
from grid_map_core_py.errors import GridMapError
from grid_map_msgs.srv import GetGridMap, ProcessFile, SetGridMap

from .. import BagWriter, bag_topics, from_message, load_from_bag, to_message, to_serialized_message
from .._mapping.cameras import DepthImages, from_camera_info
from .._mapping.elevation_fusion import read_picture
from .._mapping.elevation_parameters import InputSource, frame_name
from .._mapping.elevation_settings import PoseSettings, read_mapper_parameters, read_settings
from .._mapping.map_server import part, place_to_read, place_to_write
from .._mapping.poses import PoseHistory, Poses
from .._mapping.scan_queue import ScanQueue, read_cloud
from ..errors import RequestError
from ..messages._cdr import view
from ..nodes import (
    ConfiguredNode,
    LogThrottle,
    MapPublisher,
    TfPoses,
    dropping,
    health_of,
    offer_service,
    steady_timer,
    warn_of_gaps,
)

LOG_PERIOD = 5.0
"""Time between two lines of one cause [s]."""

WAIT_PERIOD = 0.05
"""Time between two attempts to find the poses of waiting scans [s]."""

SILENCE = 3.0
"""Time without messages after which the node says that a source is silent [s]."""


@dataclass
class Sensor:
    """A source, its scans that wait for poses, and the time of its last message [s].

    The time is infinite once the log has said that the source is silent.
    """

    source: InputSource
    queue: ScanQueue
    heard: float


class ElevationMappingNode(ConfiguredNode):
    """Wires sensors, poses, services and topics to an elevation map."""

    def __init__(self) -> None:
        super().__init__("elevation_mapping")
        self._log = LogThrottle(self.get_logger(), LOG_PERIOD)
        self._health = health_of(self)
        self._health.inputs, self._health.details = "scans", self._details
        self._updates_enabled = True
        self._settings = settings = read_settings(self)
        if settings.unused:
            text = "; ".join(settings.unused)
            self.get_logger().warning(f"parameters without effect: {text}")
        self._patch = settings.patch
        self._poses = self._make_poses(settings.poses)
        if ElevationMapper.must_compile():
            self.get_logger().info("compiles for some seconds, this first time only")
        self._fusion = settings.make_fusion()
        self._raw = MapPublisher(self, "~/elevation_map_raw", self._raw_message, self._log)
        self._fused = MapPublisher(self, "~/elevation_map", self._fused_message, self._log)
        self._sensors = [self._sensor(source) for source in settings.sources]
        for kind, action in (
            (GetGridMap, self._get_submap),
            (GetGridMap, self._get_raw_submap),
            (SetGridMap, self._masked_replace),
            (ProcessFile, self._save_map),
            (ProcessFile, self._load_map),
            (Empty, self._clear_map),
            (Empty, self._trigger_fusion),
            (Empty, self._disable_updates),
            (Empty, self._enable_updates),
            (Trigger, self._reload_parameters),
        ):
            offer_service(self, kind, action.__name__.removeprefix("_"), action, self._log)
        self._published = {"raw": 0, "fused": 0}
        steady_timer(self, 1 / settings.raw_rate, partial(self._publish, "raw"))
        if 0 < settings.fused_rate < math.inf:
            steady_timer(self, 1 / settings.fused_rate, partial(self._publish, "fused"))
        steady_timer(self, WAIT_PERIOD, self._work)
        topics = ", ".join(f"{each.source.topic}" for each in self._sensors) or "nothing"
        self.get_logger().info(f"maps {topics}, poses: {settings.poses.source}")

    # --- sensors ----------------------------------------------------------------------------------

    def _make_poses(self, settings: PoseSettings) -> Poses:
        """Return the source of poses, and subscribe to their topic."""
        history = PoseHistory(
            settings.map_frame, None, settings.count, settings.track_point, with_covariances=True
        )
        if settings.topic:
            qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
            on_pose = partial(self._on_pose, history)
            self.create_subscription(settings.kind, settings.topic, on_pose, qos)
        if settings.source == "tf":
            return TfPoses(
                self,
                settings.map_frame,
                settings.base_frame,
                track_frame=settings.track_frame,
                track_point=settings.track_point,
                covariances=history if settings.topic else None,
            )
        return history if settings.source == "topic" else Poses(settings.map_frame)

    def _sensor(self, source: InputSource) -> Sensor:
        """Subscribe to a source."""
        fuse = self._fusion.paint if source.type == "image" else self._fusion.fuse
        read: Any = partial(read_cloud, fields=source.channels)
        kind, what = PointCloud2, "a cloud"
        if source.type != "pointcloud":
            kind, what = Image, "an image"
            depths = DepthImages(source.stride)
            self.create_subscription(
                CameraInfo,
                source.camera_info_topic,
                partial(self._on_camera, depths),
                QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
            )
            is_depth = source.type == "depth_image"

            def read(data: bytes) -> Any:
                message = view(data, Image)
                return depths.read(message) if is_depth else read_picture(message, depths.camera)

        poses = self._poses
        if isinstance(poses, PoseHistory):
            poses = poses.mounted(source.sensor)
        queue = ScanQueue(
            poses,
            read,
            partial(fuse, source),
            self._drop,
            what=f"{what} of {source.name}",
            timeout=self._settings.poses.timeout,
            queue_size=source.queue_size,
        )
        sensor = Sensor(source, queue, time.monotonic())
        policy = ReliabilityPolicy.RELIABLE if source.is_reliable else ReliabilityPolicy.BEST_EFFORT
        # Raw messages are read without a copy.
        self.create_subscription(
            kind,
            source.topic,
            partial(self._on_scan, sensor),
            QoSProfile(depth=source.queue_size, reliability=policy),
            event_callbacks=SubscriptionEventCallbacks(
                message_lost=warn_of_gaps(self, source.topic)
            ),
            raw=True,
        )
        return sensor

    def _on_camera(self, depths: DepthImages, message: CameraInfo) -> None:
        with dropping(self._log, "dropped a camera_info"):
            depths.camera = from_camera_info(message)

    def _on_scan(self, sensor: Sensor, data: bytes) -> None:
        sensor.heard = time.monotonic()
        if not self._updates_enabled:
            return
        self._health.receive()
        self._note(sensor, sensor.queue.add(data))

    def _on_pose(self, history: PoseHistory, message: Odometry | PoseStamped) -> None:
        with dropping(self._log, "dropped a pose"):
            history.add(message)
            self._work()

    def _drop(self, text: str) -> None:
        self._health.drop(text)
        self._log.error(text)

    def _work(self) -> None:
        self._lay_patch()
        now = time.monotonic()
        for sensor in self._sensors:
            self._note(sensor, sensor.queue.work())
            if now - sensor.heard > SILENCE:
                sensor.heard = math.inf
                self._log.warning(f"no messages of {sensor.source.name} on {sensor.source.topic}")

    def _lay_patch(self) -> None:
        if self._patch is None:
            return
        with dropping(self._log, "initialize_elevation_map"):
            frame = self._poses.frame_at(self._settings.patch_frame, 0)
            if frame is not None:
                self._fusion.lay(self._patch, frame)
                self._patch = None
                self._publish("raw")

    def _note(self, sensor: Sensor, has_changed: bool) -> None:
        if not has_changed:
            return
        fused = sum(each.queue.statistics.fused for each in self._sensors)
        self._health.use(fused - self._health.used)
        for text in self._fusion.warnings:
            self._log.warning(text)
        self._fusion.warnings.clear()
        if sensor.source.publish_on_update:
            self._publish("raw")
            if self._settings.fused_rate == math.inf:
                self._publish("fused")

    # --- maps -------------------------------------------------------------------------------------

    def _publish(self, which: str) -> None:
        """Publish a map that has changed since it was published last."""
        publisher = self._raw if which == "raw" else self._fused
        if self._published[which] != self._fusion.version:
            publisher.publish()
            self._published[which] = self._fusion.version

    def _raw_message(self) -> bytes | None:
        if self._fusion.changed is None:
            return None
        return to_serialized_message(self._fusion.grid_map)

    def _fused_message(self) -> bytes | None:
        if self._fusion.changed is None:
            return None
        grid_map, start = self._filtered()
        return to_serialized_message(grid_map, start_index=start)

    def _filtered(self) -> tuple[GridMap, tuple[int, int]]:
        """Return the map after the pipeline, in map order, and its start index."""
        grid_map, texts = self._fusion.fused_map, list[str]()
        if self._settings.chain is None:
            return grid_map, grid_map.start_index
        begin = time.perf_counter()
        try:
            result = self._settings.chain.without_copies(grid_map, warnings=texts)
        finally:
            for text in texts:
                self._log.warning(text)
        milliseconds = 1e3 * (time.perf_counter() - begin)
        self._fusion.time("pipeline", milliseconds)
        return result

    def _details(self) -> dict[str, str]:
        """Return further values for the diagnostics."""
        fusion, found = self._fusion, dict[str, str]()
        age = math.nan if fusion.changed is None else time.monotonic() - fusion.changed
        found["seconds since the last change of the map"] = f"{age:.1f}"
        found["updates"] = "enabled" if self._updates_enabled else "disabled"
        for sensor in self._sensors:
            scans = sensor.queue.statistics
            found[sensor.source.name] = f"{scans.fused} fused, {scans.dropped} dropped"
        if fusion.report is not None:
            for name, value in vars(fusion.report).items():
                if not isinstance(value, Mapping):
                    found[f"{name.replace('_', ' ')} in the last scan"] = f"{value:g}"
            for reason, count in fusion.report.reasons.items():
                found[f"points dropped in the last scan: {reason}"] = str(count)
        for stage, (last, mean) in fusion.milliseconds.items():
            found[f"ms {stage}"], found[f"mean ms {stage}"] = f"{last:.3f}", f"{mean:.3f}"
        return found

    # --- services ---------------------------------------------------------------------------------

    def _get_submap(self, request: Any, response: Any) -> None:
        response.map = _answer(self._filtered()[0], request)

    def _get_raw_submap(self, request: Any, response: Any) -> None:
        response.map = _answer(self._fusion.grid_map, request)

    def _masked_replace(self, request: Any, _response: Any) -> None:
        given = from_message(request.map, unwrap=False)
        self._fusion.replace(given, self._settings.files.mask_layer)
        self._publish("raw")

    def _save_map(self, request: Any, response: Any) -> None:
        topic, files = _topic_of(request), self._settings.files
        filtered, _ = self._filtered()
        with (
            place_to_write(files.directory, request.file_path) as path,
            BagWriter(path, storage=files.storage) as bag,
        ):
            bag.write(topic, filtered)
            bag.write(f"{topic}_raw", self._fusion.grid_map)
        response.success = True

    def _load_map(self, request: Any, response: Any) -> None:
        topic = _topic_of(request)
        with place_to_read(self._settings.files.directory, request.file_path) as path:
            names = [each.name for each in bag_topics(path)]
            found = next((name for name in (f"{topic}_raw", topic) if name in names), topic)
            self._fusion.load(load_from_bag(path, found, unwrap=False))
        self._publish("raw")
        response.success = True

    def _clear_map(self, _request: Any, _response: Any) -> None:
        self._fusion.clear()
        self._publish("raw")

    def _trigger_fusion(self, _request: Any, _response: Any) -> None:
        self._fused.publish()

    def _disable_updates(self, _request: Any, _response: Any) -> None:
        self._updates_enabled = False

    def _enable_updates(self, _request: Any, _response: Any) -> None:
        self._updates_enabled = True

    def _reload_parameters(self, _request: Any, response: Any) -> None:
        try:
            self._fusion.mapper.configure(**read_mapper_parameters(self))
            response.success, response.message = True, "the map has the parameters that were set"
        except GridMapError as error:
            response.message = str(error)


def _answer(grid_map: GridMap, request: Any) -> Any:
    """Return the part of a map that a request names, as a message."""
    position = request.position_x, request.position_y
    length = request.length_x, request.length_y
    found = part(grid_map, frame_name(request.frame_id), position, length)
    return to_message(found, request.layers or None)


def _topic_of(request: Any) -> str:
    """Return the topic of the filtered map in a bag; that of the raw map ends with `_raw`."""
    name = request.topic_name or "elevation_map"
    if "/" in name:
        raise RequestError(f"topic_name: expected a name without slashes, got {name!r}")
    return f"/{name}"


if __name__ == "__main__":
    raise SystemExit(ElevationMappingNode.main())
