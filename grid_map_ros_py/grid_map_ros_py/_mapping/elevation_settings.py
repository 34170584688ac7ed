# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the node `elevation_mapping`, read from its parameters.

Parameters are read in the order of the table on the page of the node.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry

from grid_map_core_py import GridGeometry
from grid_map_core_py._parameters import build, cast, descriptions
from grid_map_core_py.elevation import ElevationMapper, Parameters
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import check

from ..bags._bag import STORAGES
from ..nodes import ConfiguredNode, has_tf, names_below, read_parameter, read_parameter_tree
from .elevation_fusion import ElevationFusion, Patch
from .elevation_parameters import (
    UNUSED_PARAMETERS,
    InputSource,
    channel_fusions,
    frame_name,
    read_source,
)
from .pose_types import POSE_TYPES
from .postprocessing import Chain, make_chain

POSE_SOURCES = ("auto", "tf", "topic", "none")


@dataclass(frozen=True)
class PoseSettings:
    """Where poses come from, and which point the map follows.

    Attributes:
        map_frame, base_frame: frames of the map and of the robot.
        track_frame: frame of the point that the map follows; empty means that of the robot.
        track_point: the point in that frame [m].
        source: `tf`, `topic` or `none`.
        topic: topic of poses of the robot; empty if none are needed.
        kind: type of the messages of that topic.
        count: number of poses that are kept.
        timeout: maximum time a scan waits for its pose [s].
    """

    map_frame: str
    base_frame: str
    track_frame: str
    track_point: list[float]
    source: str
    topic: str
    kind: type[Odometry | PoseStamped | PoseWithCovarianceStamped]
    count: int
    timeout: float


@dataclass(frozen=True)
class FileSettings:
    """Files and layers that services read and write.

    Attributes:
        mask_layer: layer that is NaN where `masked_replace` keeps the values of cells.
        directory: folder below which maps are saved and loaded; None refuses both.
        storage: file format of saved bags.
    """

    mask_layer: str
    directory: Path | None
    storage: str


@dataclass(frozen=True)
class Settings:
    """Settings of the node.

    Attributes:
        poses: where poses come from.
        make_fusion: function that makes the fusion, which may compile for long.
        patch: flat patch with which the map begins; None without a patch.
        patch_frame: frame at whose origin the patch is.
        chain: filters of the filtered map; None without filters.
        files: files and layers that services read and write.
        raw_rate: rate at which a changed raw map is published [Hz].
        fused_rate: the same for the filtered map; 0 means on request, infinity with the raw map.
        sources: topics of scans and images.
        unused: given parameters without effect, each with the reason.
    """

    poses: PoseSettings
    make_fusion: Callable[[], ElevationFusion]
    patch: Patch | None
    patch_frame: str
    chain: Chain | None
    files: FileSettings
    raw_rate: float
    fused_rate: float
    sources: list[InputSource]
    unused: list[str]


def read_settings(node: ConfiguredNode) -> Settings:
    """Return the settings of a node, which declares all its parameters.

    Raises:
        ConfigError: a parameter is invalid.
        MissingPackageError: no installed package has filter chains, and there is one.
    """
    sources = _read_sources(node)
    poses = _read_poses(node)
    make_fusion = _read_fusion(node, poses, sources)
    patch, patch_frame = _read_patch(node, poses)
    chain = _read_chain(node)
    files = _read_files(node)
    raw_rate, fused_rate = _read_rates(node)
    return Settings(
        poses=poses,
        make_fusion=make_fusion,
        patch=patch,
        patch_frame=patch_frame,
        chain=chain,
        files=files,
        raw_rate=raw_rate,
        fused_rate=fused_rate,
        sources=sources,
        unused=_read_unused(node, sources),
    )


def read_mapper_parameters(
    node: ConfiguredNode, sources: Sequence[InputSource] = ()
) -> dict[str, Any]:
    """Return the parameters of the mapper as they are now; the first call declares them.

    `max_variance` fits the models of all sources by default.
    """
    kinds, abouts = get_type_hints(Parameters), descriptions(Parameters)
    defaults = {field.name: field.default for field in fields(Parameters)}
    limits = [getattr(source.processor.model, "max_variance", 0.0) for source in sources]
    defaults["max_variance"] = max(limits, default=defaults["max_variance"])
    return {
        name: read_parameter(
            node, name, kinds[name], default, description=abouts[name], read_only=False
        )
        for name, default in defaults.items()
    }


def _read_poses(node: ConfiguredNode) -> PoseSettings:
    about = "frame of the map, which drifts without jumps, such as that of odometry"
    map_frame = frame_name(node.read("map_frame_id", "map", about))
    about = "frame of the robot; heights that are ignored are relative to it"
    base = frame_name(node.read("robot_base_frame_id", "base_link", about))
    about = "frame of the point that the map follows, with tf; empty means that of the robot"
    track = frame_name(node.read("track_point_frame_id", "", about))
    abouts = {axis: f"{axis} of the point that the map follows [m], in its frame" for axis in "xyz"}
    point = [node.read(f"track_point_{axis}", 0.0, about) for axis, about in abouts.items()]
    check(bool(np.isfinite(point).all()), "track_point_x, _y, _z", "finite numbers", point)
    about = (
        "`tf`, `topic` (poses of the robot from `robot_pose_with_covariance_topic`) or `none` "
        "(scans are in the frame of the map); `auto` means `tf` where tf2 is installed, else "
        "`topic`"
    )
    source = node.read_choice("pose_source", POSE_SOURCES, "auto", about)
    if source == "auto":
        source = "tf" if has_tf() else "topic"
    about = (
        "topic of the poses of the robot in the frame of the map; with tf, their covariances "
        "alone are used, and an empty name means exact poses"
    )
    topic = node.read_topic("robot_pose_with_covariance_topic", "", about)
    about = "messages of that topic: `pose_with_covariance`, `odometry` or `pose`"
    kind = node.read_choice("pose_type", POSE_TYPES, "pose_with_covariance", about)
    count = node.read("robot_pose_cache_size", 200, "number of poses that are kept")
    check(count > 0, "robot_pose_cache_size", "at least 1", count)
    about = "maximum time a scan waits for its pose [s]"
    timeout = node.read_number("pose_timeout", 1.0, 0.0, 1e9, about)
    if source == "topic":
        topic = topic or "/pose"
    elif source == "none":
        topic = ""
    return PoseSettings(
        map_frame, base, track, point, source, topic, POSE_TYPES[kind], count, timeout
    )


def _read_fusion(
    node: ConfiguredNode, poses: PoseSettings, sources: Sequence[InputSource]
) -> Callable[[], ElevationFusion]:
    length = [
        node.read(f"length_in_{axis}", 1.5, f"side length of the map along {axis} [m]")
        for axis in "xy"
    ]
    place = [
        node.read(f"position_{axis}", 0.0, f"initial {axis} of the center of the map [m]")
        for axis in "xy"
    ]
    resolution = node.read("resolution", 0.01, "side of a cell [m]")
    geometry = GridGeometry(np.array(length), resolution, np.array(place))
    check_cells("length_in_x, length_in_y", geometry.size)
    values = read_mapper_parameters(node, sources)
    about = "0 disables the visibility cleanup, which runs with every scan otherwise"
    if node.read("visibility_cleanup_rate", 1.0, about) == 0:
        values["enable_visibility_cleanup"] = False
    about = "whether every scan begins a new map"
    clears = node.read("enable_continuous_cleanup", False, about)
    motion = _tree(node, "robot_motion_map_update", "`covariance_scale`: factor of covariances")
    scale = cast("robot_motion_map_update", motion.get("covariance_scale", 1.0), float)
    about = "how fields of clouds become layers, by their names or regular expressions"
    fusions = channel_fusions(_tree(node, "pointcloud_channel_fusions", about))
    about = "the same for channels of images: `color`, `latest` or `exponential`"
    image_fusions = channel_fusions(_tree(node, "image_channel_fusions", about))
    build(Parameters, values)
    return lambda: ElevationFusion(
        ElevationMapper(geometry, poses.map_frame, value_fusions=fusions, **values),
        follow=poses.source != "none",
        covariance_scale=scale,
        clears_before_scan=clears,
        image_fusions=image_fusions,
    )


def _read_patch(node: ConfiguredNode, poses: PoseSettings) -> tuple[Patch | None, str]:
    about = "whether the map begins with a flat patch around the robot"
    is_wanted = node.read("initialize_elevation_map", False, about)
    length = [
        node.read_positive(
            f"length_in_{axis}_init_submap", size, f"side length of the patch along {axis} [m]"
        )
        for axis, size in (("x", 1.2), ("y", 1.8))
    ]
    about = "height of the patch above the origin of its frame [m]"
    offset = node.read("init_submap_height_offset", 0.0, about)
    variance = node.read_positive("init_submap_variance", 0.01, "variance of the patch [m^2]")
    about = "frame at whose origin the patch is, with tf; empty means that of the robot"
    frame = frame_name(node.read("target_frame_init_submap", "", about))
    patch = Patch((length[0], length[1]), offset, variance)
    has_place = is_wanted and poses.source != "none"
    return patch if has_place else None, frame or poses.base_frame


def _read_chain(node: ConfiguredNode) -> Chain | None:
    about = "name of the parameter with the filter chain of `~/elevation_map`"
    name = node.read("postprocessor_pipeline_name", "postprocessor_pipeline", about)
    about = "the chain: `filter1`, `filter2`, ... with `name`, `type` and `params`"
    config = _tree(node, name, about)
    about = "number of threads that the filters may use"
    threads = node.read("postprocessor_num_threads", 1, about)
    return make_chain(config, threads) if config else None


def _read_files(node: ConfiguredNode) -> FileSettings:
    about = "layer of the map of `masked_replace` that is NaN where cells keep their values"
    mask_layer = node.read("masked_replace_service_mask_layer_name", "mask", about)
    about = "directory below which requests load and save maps; empty refuses them"
    path = node.read("directory", "", about)
    check(not path or Path(path).is_dir(), "directory", "a directory that exists", path)
    about = "file format of saved bags: `mcap` or `sqlite3`"
    storage = node.read_choice("storage", STORAGES, "mcap", about)
    return FileSettings(mask_layer, Path(path) if path else None, storage)


def _read_rates(node: ConfiguredNode) -> tuple[float, float]:
    about = "rate at which a changed raw map that was not published yet is published [Hz]"
    raw = node.read_positive("min_update_rate", 2.0, about)
    about = (
        "rate at which the filtered map is published [Hz]; 0 means after `trigger_fusion` "
        "only, `.inf` together with the raw map"
    )
    return raw, node.read_number("fused_map_publishing_rate", 1.0, 0.0, math.inf, about)


def _read_sources(node: ConfiguredNode) -> list[InputSource]:
    about = "sensor model of sources without one of their own: `type` and its parameters"
    default = _tree(node, "sensor_processor", about)
    names = names_below(node, "input_sources")
    about = "topic of clouds if there are no `input_sources`; deprecated"
    topic = node.read("point_cloud_topic", "/points", about)
    about = "names of sources are free; each has the parameters below"
    if not names and not node.has_parameter("input_sources"):
        read_parameter(node, "input_sources.points.topic", str, topic, description=about)
        names = ["points"]
    about = "sensor model of the source: `type` and its parameters"
    return [
        read_source(
            partial(read_parameter, node),
            name,
            _tree(node, f"input_sources.{name}.sensor_processor", about),
            default,
        )
        for name in names
    ]


def _read_unused(node: ConfiguredNode, sources: list[InputSource]) -> list[str]:
    given = [name for name in UNUSED_PARAMETERS if name in node._parameter_overrides]
    for name in given:
        value = node._parameter_overrides[name].value
        read_parameter(node, name, type(value), value, description="no effect")
    texts = [f"{name} ({UNUSED_PARAMETERS[name]})" for name in given]
    for source in sources:
        place = f"input_sources.{source.name}.sensor_processor"
        texts += [f"{place}.{text}" for text in source.processor.unused]
    return texts


def _tree(node: ConfiguredNode, name: str, about: str) -> dict[str, Any]:
    return read_parameter_tree(node, name, description=about)
