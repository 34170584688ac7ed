# Copyright (c) 2026 grid_map_py contributors
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
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Empty, Trigger

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.elevation import ElevationMapper, Parameters
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import build, cast, check, descriptions
from grid_map_msgs.srv import GetGridMap, ProcessFile, SetGridMap

from .. import BagWriter, bag_topics, from_message, load_from_bag, to_message, to_serialized_message
from .._mapping.cameras import DepthImages, from_camera_info
from .._mapping.elevation_fusion import ElevationFusion, Patch, read_picture
from .._mapping.elevation_parameters import (
    UNUSED_PARAMETERS,
    InputSource,
    channel_fusions,
    frame_name,
    read_source,
)
from .._mapping.map_server import part, place_to_read, place_to_write
from .._mapping.poses import PoseHistory, Poses
from .._mapping.postprocessing import Chain, make_chain
from .._mapping.scan_queue import ScanQueue, read_cloud
from ..bags._bag import STORAGES
from ..errors import RequestError
from ..messages._cdr import view
from ..nodes import (
    ConfiguredNode,
    LogThrottle,
    MapPublisher,
    TfPoses,
    dropping,
    has_tf,
    health_of,
    names_below,
    offer_service,
    read_parameter,
    read_parameter_tree,
    steady_timer,
    warn_of_gaps,
)

POSE_TYPES = {
    "pose_with_covariance": PoseWithCovarianceStamped,
    "odometry": Odometry,
    "pose": PoseStamped,
}
POSE_SOURCES = ("auto", "tf", "topic", "none")

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
        self._read_poses()
        make_fusion = self._read_fusion()
        self._read_patch()
        self._read_pipeline()
        self._read_files()
        self._read_rates()
        sources = self._read_sources()
        self._warn_of_unused(sources)
        self.get_logger().info("prepares the map; the first time it compiles, for half a minute")
        self._fusion = make_fusion()
        self._raw = MapPublisher(self, "~/elevation_map_raw", self._raw_message, self._log)
        self._fused = MapPublisher(self, "~/elevation_map", self._fused_message, self._log)
        self._sensors = [self._sensor(source) for source in sources]
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
        steady_timer(self, WAIT_PERIOD, self._work)
        topics = ", ".join(f"{each.source.topic}" for each in self._sensors) or "nothing"
        self.get_logger().info(f"maps {topics}, poses: {self._pose_source}")

    # --- parameters -------------------------------------------------------------------------------

    def _read_poses(self) -> None:
        about = "frame of the map, which drifts without jumps, such as that of odometry"
        self._map_frame = frame_name(self.read("map_frame_id", "map", about))
        about = "frame of the robot; heights that are ignored are relative to it"
        base = frame_name(self.read("robot_base_frame_id", "base_link", about))
        about = "frame of the point that the map follows, with tf; empty means that of the robot"
        track = frame_name(self.read("track_point_frame_id", "", about))
        abouts = {
            axis: f"{axis} of the point that the map follows [m], in its frame" for axis in "xyz"
        }
        point = [self.read(f"track_point_{axis}", 0.0, about) for axis, about in abouts.items()]
        check(bool(np.isfinite(point).all()), "track_point_x, _y, _z", "finite numbers", point)
        about = (
            "`tf`, `topic` (poses of the robot from `robot_pose_with_covariance_topic`) or `none` "
            "(scans are in the frame of the map); `auto` means `tf` where tf2 is installed, else "
            "`topic`"
        )
        source = self.read_choice("pose_source", POSE_SOURCES, "auto", about)
        self._pose_source = ("tf" if has_tf() else "topic") if source == "auto" else source
        about = (
            "topic of the poses of the robot in the frame of the map; with tf, their covariances "
            "alone are used, and an empty name means exact poses"
        )
        topic = self.read_topic("robot_pose_with_covariance_topic", "", about)
        if self._pose_source == "topic":
            topic = topic or "/pose"
        about = "messages of that topic: `pose_with_covariance`, `odometry` or `pose`"
        kind = self.read_choice("pose_type", POSE_TYPES, "pose_with_covariance", about)
        size = self.read("robot_pose_cache_size", 200, "number of poses that are kept")
        check(size > 0, "robot_pose_cache_size", "at least 1", size)
        about = "maximum time a scan waits for its pose [s]"
        self._pose_timeout = self.read_number("pose_timeout", 1.0, 0.0, 1e9, about)
        self._history = PoseHistory(self._map_frame, None, size, point, with_covariances=True)
        self._base_frame, self._poses = base, Poses(self._map_frame)
        if self._pose_source == "tf":
            covariances = self._history if topic else None
            self._poses = TfPoses(
                self,
                self._map_frame,
                base,
                track_frame=track,
                track_point=point,
                covariances=covariances,
            )
        elif self._pose_source == "topic":
            self._poses = self._history
        if topic and self._pose_source != "none":
            qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
            self.create_subscription(POSE_TYPES[kind], topic, self._on_pose, qos)

    def _read_fusion(self) -> Callable[[], ElevationFusion]:
        """Return a function that makes the fusion, which may compile for long."""
        length = [
            self.read(f"length_in_{axis}", 1.5, f"side length of the map along {axis} [m]")
            for axis in "xy"
        ]
        place = [
            self.read(f"position_{axis}", 0.0, f"initial {axis} of the center of the map [m]")
            for axis in "xy"
        ]
        resolution = self.read("resolution", 0.01, "side of a cell [m]")
        geometry = GridGeometry(np.array(length), resolution, np.array(place))
        check_cells("length_in_x, length_in_y", geometry.size)
        values = self._read_mapper_parameters()
        about = "0 disables the visibility cleanup, which runs with every scan otherwise"
        if self.read("visibility_cleanup_rate", 1.0, about) == 0:
            values["enable_visibility_cleanup"] = False
        about = "time by which scans of several sensors may come out of order [s]; 1 s at least"
        tolerance = self.read_number("time_tolerance", 0.0, 0.0, 1e9, about)
        about = "whether every scan begins a new map"
        clears = self.read("enable_continuous_cleanup", False, about)
        motion = self._tree("robot_motion_map_update", "`covariance_scale`: factor of covariances")
        scale = cast("robot_motion_map_update", motion.get("covariance_scale", 1.0), float)
        about = "how fields of clouds become layers, by their names or regular expressions"
        fusions = channel_fusions(self._tree("pointcloud_channel_fusions", about))
        about = "the same for channels of images: `color`, `latest` or `exponential`"
        image_fusions = channel_fusions(self._tree("image_channel_fusions", about))
        build(Parameters, values)
        return lambda: ElevationFusion(
            ElevationMapper(geometry, self._map_frame, value_fusions=fusions, **values),
            follow=self._pose_source != "none",
            covariance_scale=scale,
            time_tolerance=tolerance,
            clears_before_scan=clears,
            image_fusions=image_fusions,
        )

    def _read_mapper_parameters(self) -> dict[str, Any]:
        """Return the parameters of the mapper as they are now."""
        kinds, abouts = get_type_hints(Parameters), descriptions(Parameters)
        return {
            field.name: read_parameter(
                self,
                field.name,
                kinds[field.name],
                field.default,
                description=abouts[field.name],
                read_only=False,
            )
            for field in fields(Parameters)
        }

    def _read_patch(self) -> None:
        about = "whether the map begins with a flat patch around the robot"
        is_wanted = self.read("initialize_elevation_map", False, about)
        length = [
            self.read_positive(
                f"length_in_{axis}_init_submap", size, f"side length of the patch along {axis} [m]"
            )
            for axis, size in (("x", 1.2), ("y", 1.8))
        ]
        about = "height of the patch above the origin of its frame [m]"
        offset = self.read("init_submap_height_offset", 0.0, about)
        variance = self.read_positive("init_submap_variance", 0.01, "variance of the patch [m^2]")
        about = "frame at whose origin the patch is, with tf; empty means that of the robot"
        frame = frame_name(self.read("target_frame_init_submap", "", about))
        self._patch_frame = frame or self._base_frame
        patch = Patch((length[0], length[1]), offset, variance)
        self._patch = patch if is_wanted and self._pose_source != "none" else None

    def _read_pipeline(self) -> None:
        about = "name of the parameter with the filter chain of `~/elevation_map`"
        name = self.read("postprocessor_pipeline_name", "postprocessor_pipeline", about)
        about = "the chain: `filter1`, `filter2`, ... with `name`, `type` and `params`"
        config = read_parameter_tree(self, name, description=about)
        about = "number of threads that the filters may use"
        threads = self.read("postprocessor_num_threads", 1, about)
        self._chain: Chain | None = make_chain(config, threads) if config else None

    def _read_files(self) -> None:
        about = "layer of the map of `masked_replace` that is NaN where cells keep their values"
        self._mask_layer = self.read("masked_replace_service_mask_layer_name", "mask", about)
        about = "directory below which requests load and save maps; empty refuses them"
        path = self.read("directory", "", about)
        check(not path or Path(path).is_dir(), "directory", "a directory that exists", path)
        self._directory = Path(path) if path else None
        about = "file format of saved bags: `mcap` or `sqlite3`"
        self._storage = self.read_choice("storage", STORAGES, "mcap", about)

    def _read_rates(self) -> None:
        about = "rate at which a changed raw map that was not published yet is published [Hz]"
        rate = self.read_positive("min_update_rate", 2.0, about)
        self._published = {"raw": 0, "fused": 0}
        steady_timer(self, 1 / rate, partial(self._publish, "raw"))
        about = (
            "rate at which the filtered map is published [Hz]; 0 means after `trigger_fusion` "
            "only, `.inf` together with the raw map"
        )
        rate = self.read_number("fused_map_publishing_rate", 1.0, 0.0, math.inf, about)
        self._fuses_always = rate == math.inf
        if 0 < rate < math.inf:
            steady_timer(self, 1 / rate, partial(self._publish, "fused"))

    def _read_sources(self) -> list[InputSource]:
        about = "sensor model of sources without one of their own: `type` and its parameters"
        default = self._tree("sensor_processor", about)
        names = names_below(self, "input_sources")
        about = "topic of clouds if there are no `input_sources`; deprecated"
        topic = self.read("point_cloud_topic", "/points", about)
        about = "names of sources are free; each has the parameters below"
        if not names and not self.has_parameter("input_sources"):
            read_parameter(self, "input_sources.points.topic", str, topic, description=about)
            names = ["points"]
        about = "sensor model of the source: `type` and its parameters"
        return [
            read_source(
                partial(read_parameter, self),
                name,
                read_parameter_tree(
                    self, f"input_sources.{name}.sensor_processor", description=about
                ),
                default,
            )
            for name in names
        ]

    def _tree(self, name: str, about: str) -> dict[str, Any]:
        return read_parameter_tree(self, name, description=about)

    def _warn_of_unused(self, sources: list[InputSource]) -> None:
        given = [name for name in UNUSED_PARAMETERS if name in self._parameter_overrides]
        for name in given:
            value = self._parameter_overrides[name].value
            read_parameter(self, name, type(value), value, description="no effect")
        texts = [f"{name} ({UNUSED_PARAMETERS[name]})" for name in given]
        for source in sources:
            place = f"input_sources.{source.name}.sensor_processor"
            texts += [f"{place}.{text}" for text in source.processor.unused]
        if texts:
            self.get_logger().warning(f"parameters without effect: {'; '.join(texts)}")

    # --- sensors ----------------------------------------------------------------------------------

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
            timeout=self._pose_timeout,
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

    def _on_pose(self, message: Odometry | PoseStamped) -> None:
        with dropping(self._log, "dropped a pose"):
            self._history.add(message)
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
            frame = self._poses.frame_at(self._patch_frame, 0)
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
            if self._fuses_always:
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
        if self._chain is None:
            return grid_map, grid_map.start_index
        begin = time.perf_counter()
        try:
            result = self._chain.without_copies(grid_map, warnings=texts)
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
            counts = sensor.queue.statistics
            found[sensor.source.name] = f"{counts.fused} fused, {counts.dropped} dropped"
        if fusion.report is not None:
            for name, value in vars(fusion.report).items():
                if name != "milliseconds":
                    found[f"{name.replace('_', ' ')} in the last scan"] = f"{value:g}"
        for stage, (last, mean) in fusion.milliseconds.items():
            found[f"ms {stage}"], found[f"mean ms {stage}"] = f"{last:.3f}", f"{mean:.3f}"
        return found

    # --- services ---------------------------------------------------------------------------------

    def _get_submap(self, request: Any, response: Any) -> None:
        response.map = _answer(self._filtered()[0], request)

    def _get_raw_submap(self, request: Any, response: Any) -> None:
        response.map = _answer(self._fusion.grid_map, request)

    def _masked_replace(self, request: Any, _response: Any) -> None:
        self._fusion.replace(from_message(request.map, unwrap=False), self._mask_layer)
        self._publish("raw")

    def _save_map(self, request: Any, response: Any) -> None:
        topic = _topic_of(request)
        filtered, _ = self._filtered()
        with (
            place_to_write(self._directory, request.file_path) as path,
            BagWriter(path, storage=self._storage) as bag,
        ):
            bag.write(topic, filtered)
            bag.write(f"{topic}_raw", self._fusion.grid_map)
        response.success = True

    def _load_map(self, request: Any, response: Any) -> None:
        topic = _topic_of(request)
        with place_to_read(self._directory, request.file_path) as path:
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
            self._fusion.mapper.configure(**self._read_mapper_parameters())
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
