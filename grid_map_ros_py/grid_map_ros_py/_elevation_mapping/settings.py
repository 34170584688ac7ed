# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of the `elevation_mapping` node."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from grid_map_core_py import GridGeometry
from grid_map_core_py._parameters import cast
from grid_map_core_py.elevation import ElevationMapper
from grid_map_core_py.elevation._parameters import Parameters
from grid_map_core_py.errors import ConfigError, hint
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import check

from ..nodes import ConfiguredNode, read_parameter, read_parameter_tree
from ..nodes._parameters import check_topic, names_below, read_fields
from ..nodes._poses import frame_name
from .fusion import ElevationFusion
from .outputs import Chain, make_chain
from .sources import (
    UNUSED_PARAMETERS,
    InputSource,
    SourceSettings,
    channel_fusions,
    sensor_processor,
)

POSITIVE = (
    "length_in_x_init_submap",
    "length_in_y_init_submap",
    "init_submap_variance",
    "min_update_rate",
)
"""Parameters that must be positive numbers."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Parameters of the `elevation_mapping` node, except source and mapper parameters.

    Attributes:
        map_frame_id: map frame, usually the odometry frame; poses in it must not jump.
        robot_base_frame_id: frame of the robot.
        track_point_frame_id: frame of the point that the map follows (tf only); empty means the
            robot frame.
        track_point_x, track_point_y, track_point_z: coordinate of the followed point in
            `track_point_frame_id` [m].
        pose_source: source of the poses; `auto` means `tf` if tf2 is installed, else `topic`.
        robot_pose_with_covariance_topic: topic of the robot poses. Without tf, empty means `/pose`.
            With tf, only the covariances are used; if empty, poses are assumed to be exact.
        pose_type: message type of `robot_pose_with_covariance_topic`.
        robot_pose_cache_size: maximum number of stored poses.
        pose_timeout: maximum time a scan waits for its pose [s].
        length_in_x, length_in_y: side length of the map [m].
        position_x, position_y: coordinate of the initial map center [m].
        resolution: cell size [m].
        visibility_cleanup_rate: 0 disables visibility cleanup. Other values have no effect.
        enable_continuous_cleanup: clear the map before every scan.
        initialize_elevation_map: start with a flat patch around the robot.
        length_in_x_init_submap, length_in_y_init_submap: side length of the patch [m].
        init_submap_height_offset: height of the patch above the origin of its frame [m].
        init_submap_variance: variance of the patch [m^2].
        target_frame_init_submap: frame of the patch (tf only); empty means the robot frame.
        masked_replace_service_mask_layer_name: mask layer of `masked_replace`; cells where the mask
            is NaN stay unchanged.
        directory: directory in which services load and save maps; empty disables these services.
        storage: file format of saved bags; `auto` is `mcap`, or `sqlite3` if neither `mcap` nor
            `rosbag2_py` is installed.
        min_update_rate: rate at which the raw map is published if it has changed [Hz].
        fused_map_publishing_rate: rate at which the filtered map is published [Hz]. With 0, only
            `trigger_fusion` publishes it. With `.inf`, it is published after every scan that
            publishes the raw map.
    """

    map_frame_id: str = "map"
    robot_base_frame_id: str = "base_link"
    track_point_frame_id: str = ""
    track_point_x: float = 0.0
    track_point_y: float = 0.0
    track_point_z: float = 0.0
    pose_source: Literal["auto", "tf", "topic", "none"] = "auto"
    robot_pose_with_covariance_topic: str = ""
    pose_type: Literal["odometry", "pose", "pose_with_covariance"] = "pose_with_covariance"
    robot_pose_cache_size: int = 200
    pose_timeout: float = 1.0
    length_in_x: float = 1.5
    length_in_y: float = 1.5
    position_x: float = 0.0
    position_y: float = 0.0
    resolution: float = 0.01
    visibility_cleanup_rate: float = 1.0
    enable_continuous_cleanup: bool = False
    initialize_elevation_map: bool = False
    length_in_x_init_submap: float = 1.2
    length_in_y_init_submap: float = 1.8
    init_submap_height_offset: float = 0.0
    init_submap_variance: float = 0.01
    target_frame_init_submap: str = ""
    masked_replace_service_mask_layer_name: str = "mask"
    directory: str = ""
    storage: Literal["auto", "mcap", "sqlite3"] = "auto"
    min_update_rate: float = 2.0
    fused_map_publishing_rate: float = 1.0

    def __post_init__(self) -> None:
        finite = bool(np.isfinite(self.track_point).all())
        check(finite, "track_point_x, _y, _z", "finite numbers", self.track_point)
        count = self.robot_pose_cache_size
        check(count > 0, "robot_pose_cache_size", "at least 1", count)
        for name in POSITIVE:
            value = getattr(self, name)
            check(1e-9 <= value <= 1e9, name, "a positive number from 1e-09 to 1e+09", value)
        rate = self.fused_map_publishing_rate
        is_rate = rate in (0.0, math.inf) or 1e-9 <= rate <= 1e9
        check(is_rate, "fused_map_publishing_rate", "a positive number, 0 or .inf", rate)
        path = self.directory
        check(not path or Path(path).is_dir(), "directory", "a directory that exists", path)

    @property
    def track_point(self) -> tuple[float, float, float]:
        """Point that the map follows [m], in the track point frame."""
        return self.track_point_x, self.track_point_y, self.track_point_z


def read_sources(node: ConfiguredNode) -> list[InputSource]:
    about = "default sensor model: `type` and its parameters"
    default = read_parameter_tree(node, "sensor_processor", description=about)
    names = names_below(node, "input_sources")
    about = "deprecated: cloud topic, used if `input_sources` is missing"
    topic = node.read("point_cloud_topic", "/points", about)
    defaults = {}
    if not names and "input_sources" not in node._parameter_overrides:
        names, defaults = ["points"], {"topic": topic}
    elif not names:
        read_parameter_tree(node, "input_sources", description="[]: no source")
    sources, owners = [], dict[str, str]()
    for name in names:
        place = f"input_sources.{name}"
        about = "sensor model: `type` and its parameters"
        processor = read_parameter_tree(node, f"{place}.sensor_processor", description=about)
        settings = read_fields(node, SourceSettings, f"{place}.", defaults=defaults)
        try:
            noise = sensor_processor(processor or default)
        except ConfigError as error:
            raise ConfigError(f"{place}.sensor_processor: {error}") from error
        full = node.resolve_topic_name(check_topic(node, f"{place}.topic", settings.topic))
        expected = f"another topic than that of input_sources.{owners.setdefault(full, name)}"
        check(owners[full] == name, f"{place}.topic", expected, settings.topic)
        sources.append(InputSource(name, settings, noise))
    return sources


def read_mapper_parameters(
    node: ConfiguredNode, settings: Settings, sources: Sequence[InputSource] = ()
) -> dict[str, Any]:
    """Read the mapper parameters; the first call declares them on the node.

    The default of `max_variance` is the largest `max_variance` of the sensor models.
    """
    limits = [getattr(source.processor.model, "max_variance", 0.0) for source in sources]
    defaults = {"max_variance": max(limits, default=Parameters.max_variance)}
    found = {**vars(read_fields(node, Parameters, defaults=defaults, read_only=False))}
    if settings.visibility_cleanup_rate == 0:
        found["enable_visibility_cleanup"] = False
    return found


def read_fusion(
    node: ConfiguredNode, settings: Settings, sources: Sequence[InputSource]
) -> ElevationFusion:
    """Create the fusion; the first call on a machine may take seconds to compile code."""
    length = settings.length_in_x, settings.length_in_y
    position = settings.position_x, settings.position_y
    geometry = GridGeometry(length, settings.resolution, position)
    check_cells("length_in_x, length_in_y", geometry.size)
    parameters = read_mapper_parameters(node, settings, sources)
    about = "`covariance_scale`: factor applied to the pose covariances"
    motion = read_parameter_tree(node, "robot_motion_map_update", description=about)
    scale = cast("robot_motion_map_update", motion.get("covariance_scale", 1.0), float)
    about = "fusion methods of cloud fields, by name or regular expression"
    fields = read_parameter_tree(node, "pointcloud_channel_fusions", description=about)
    about = "fusion methods of image channels, by name or regular expression"
    channels = read_parameter_tree(node, "image_channel_fusions", description=about)
    frame, fusions = frame_name(settings.map_frame_id), channel_fusions(fields)
    return ElevationFusion(
        ElevationMapper(geometry, frame, value_fusions=fusions, **parameters),
        follow=settings.pose_source != "none",
        covariance_scale=scale,
        clears_before_scan=settings.enable_continuous_cleanup,
        image_fusions=channel_fusions(channels),
    )


def read_chain(node: ConfiguredNode) -> Chain | None:
    about = "parameter that holds the filter chain of `~/elevation_map`"
    name = node.read("postprocessor_pipeline_name", "postprocessor_pipeline", about)
    about = "filters `filter1`, `filter2`, ... with `name`, `type` and `params`"
    config = read_parameter_tree(node, name, description=about)
    about = "number of threads that the filters may use"
    threads = node.read("postprocessor_num_threads", 1, about)
    return make_chain(config, threads) if config else None


def read_unused(node: ConfiguredNode, sources: Sequence[InputSource]) -> list[str]:
    """Return the parameters that are set but have no effect, with the reasons."""
    given = [name for name in UNUSED_PARAMETERS if name in node._parameter_overrides]
    for name in given:
        value = node._parameter_overrides[name].value
        read_parameter(node, name, type(value), value, description="no effect")
    texts = [f"{name} ({UNUSED_PARAMETERS[name]})" for name in given]
    names = sorted(name.replace("/", ".") for name in node._parameter_overrides)
    motion, scale = "robot_motion_map_update.", "robot_motion_map_update.covariance_scale"
    wrong = [name for name in names if name.startswith(motion) and name != scale]
    texts += [f"{name} (unknown{hint(name, [scale])})" for name in wrong]
    needs_default = False
    for source in sources:
        place = f"input_sources.{source.name}.sensor_processor"
        texts += [f"{place}.{text}" for text in source.processor.unused]
        is_image, has_own = source.settings.type == "image", bool(names_below(node, place))
        texts += [f"{place} (images have no noise)"] * (is_image and has_own)
        needs_default |= not (is_image or has_own)
    if not needs_default and any(name.startswith("sensor_processor.") for name in names):
        texts.append("sensor_processor (no source without its own needs one)")
    return texts
