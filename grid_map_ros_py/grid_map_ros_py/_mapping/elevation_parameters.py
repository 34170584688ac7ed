# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of elevation mapping: sources of scans, sensor models, and names of other packages.

Names are those of the package `elevation_mapping` of ROS 1, and for values in layers those of
`elevation_mapping_cupy`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np

from grid_map_core_py._parameters import build, cast
from grid_map_core_py.elevation import (
    ConstantModel,
    LaserModel,
    PerfectModel,
    SensorModel,
    StereoModel,
    StructuredLightModel,
)
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check

from ..messages._pose import Matrix
from .poses import from_xyz_rpy

T = TypeVar("T")

MODELS: Mapping[str, type[SensorModel]] = {
    "laser": LaserModel,
    "structured_light": StructuredLightModel,
    "stereo": StereoModel,
    "perfect": PerfectModel,
    "constant": ConstantModel,
}
"""Sensor models by the names of their `type`."""

SOURCE_TYPES = ("pointcloud", "depth_image", "image")

_OLD_MODELS = {
    "Laser": "laser",
    "StructuredLight": "structured_light",
    "Stereo": "stereo",
    "Perfect": "perfect",
}
"""Names of models in files from before version 0.7 of the C++ package."""

_UNUSED = {
    "apply_voxelgrid_filter": "all points are fused",
    "voxelgrid_filter_size": "all points are fused",
    **dict.fromkeys(("p_2", "p_3", "p_4", "p_5"), "the stereo model has no terms of pixels"),
}
"""Parameters of sensor processors of the C++ package that have no effect, and why."""

UNUSED_PARAMETERS = {
    "increase_height_alpha": "`conflict_points` of one scan replace a height",
    "initialization_method": "there is one: a flat patch",
    "margin_init_submap": "the patch has no margin",
    "max_horizontal_variance": "`horizontal_variances` needs no limits",
    "min_horizontal_variance": "`horizontal_variances` needs no limits",
    "num_callback_threads": "one thread takes all messages",
    "relocate_rate": "the map moves with every scan",
    "scanning_time": "now `scanning_duration`",
    "surface_normal_estimation_radius": "put `NormalVectorsFilter` into the pipeline",
    "surface_normal_positive_axis": "put `NormalVectorsFilter` into the pipeline",
    "time_tolerance": "scans may be late by up to `max_time_jump`",
    "underlying_map_topic": "call `masked_replace` with the map",
}
"""Parameters of the C++ package that have no effect, and why."""


class Read(Protocol):
    """Reads a parameter of a node: `read_parameter` of `grid_map_ros_py.nodes`."""

    def __call__(self, name: str, kind: type[T], default: T, *, description: str) -> T: ...


@dataclass(frozen=True)
class SensorProcessor:
    """Noise of a sensor, and heights of its points that count.

    Attributes:
        model: the sensor model.
        above, below: points that are higher or lower, relative to the robot, are dropped [m].
        unused: parameters without effect, each with the reason.
    """

    model: SensorModel
    above: float = math.inf
    below: float = -math.inf
    unused: tuple[str, ...] = ()


def sensor_processor(parameters: Mapping[str, Any]) -> SensorProcessor:
    """Return the sensor processor of parameters: `type` and those of its model.

    Raises:
        ConfigError: the type or a parameter is unknown, or a value is invalid.
    """
    left = dict(parameters)
    kind = cast("type", left.pop("type", "laser"), str)
    kind = _OLD_MODELS.get(kind, kind)
    check(kind in MODELS, "type", f"one of {', '.join(MODELS)}", kind)
    unused = tuple(f"{name}: {_UNUSED[name]}" for name in left if name in _UNUSED)
    limits = {
        side: cast(f"ignore_points_{side}", left.pop(f"ignore_points_{side}", default), float)
        for side, default in (("above", math.inf), ("below", -math.inf))
    }
    left = {name: value for name, value in left.items() if name not in _UNUSED}
    if kind == "stereo":
        left = _stereo(left)
    return SensorProcessor(build(MODELS[kind], left), **limits, unused=unused)


def _stereo(parameters: dict[str, Any]) -> dict[str, Any]:
    """Return parameters of `StereoModel` for those of the C++ package.

    There, with p_2 to p_5 zero, the standard deviation of the depth z is sqrt(p_1) times
    z^2 / depth_to_disparity_factor.
    """
    factor = parameters.pop("depth_to_disparity_factor", None)
    variance = parameters.pop("p_1", None)
    for name in ("cutoff_min_depth", "cutoff_max_depth"):
        if name in parameters:
            raise ConfigError(f"{name} of stereo: set min_range and max_range of the source")
    if factor is not None:
        parameters |= {"focal_length": factor, "baseline": 1.0}
    if variance is not None:
        value = cast("p_1", variance, float)
        check(value >= 0, "p_1", "no negative number", value)
        parameters["disparity_std"] = math.sqrt(value)
    return parameters


@dataclass(frozen=True)
class InputSource:
    """A topic of scans or images.

    Attributes:
        name: its name in the parameters.
        type: one of `SOURCE_TYPES`.
        topic: the topic.
        camera_info_topic: topic of the camera of images.
        queue_size: maximum number of messages that wait.
        publish_on_update: whether the map is published after each of its messages.
        processor: noise of the sensor.
        channels: fields of clouds, or names of the channels of images, that become layers.
        min_range, max_range: distances of points that count [m].
        stride: rows and columns between the pixels of a depth image that are used.
        sensor: transform from its frame to that of the robot, where tf does not know it.
        is_reliable: whether lost messages are requested again.
    """

    name: str
    type: str
    topic: str
    camera_info_topic: str
    queue_size: int
    publish_on_update: bool
    processor: SensorProcessor
    channels: tuple[str, ...]
    min_range: float
    max_range: float
    stride: int
    sensor: Matrix
    is_reliable: bool


def read_source(
    read: Read, name: str, processor: Mapping[str, Any], default: Mapping[str, Any]
) -> InputSource:
    """Return the source `name` of the parameters below `input_sources.name`.

    Args:
        read: reads a parameter.
        name: name of the source.
        processor: parameters of its `sensor_processor`; empty takes the default.
        default: parameters of the `sensor_processor` of sources without one.

    Raises:
        ConfigError: a parameter is invalid.
    """

    place = f"input_sources.{name}"

    def value(key: str, kind: type[T], otherwise: T, description: str) -> T:
        return read(f"{place}.{key}", kind, otherwise, description=description)

    kind = value("type", str, "pointcloud", "`pointcloud`, `depth_image` or `image`")
    check(kind in SOURCE_TYPES, f"{place}.type", f"one of {', '.join(SOURCE_TYPES)}", kind)
    topic = value("topic", str, "", "topic of the clouds or images")
    check(topic != "", f"{place}.topic", "the name of a topic", topic)
    about = (
        "for images: topic of `sensor_msgs/CameraInfo`; empty means `camera_info` beside `topic`"
    )
    info = value("camera_info_topic", str, "", about)
    about = "maximum number of messages that wait for the node or for a pose"
    queue_size = value("queue_size", int, 10, about)
    check(queue_size >= 0, f"{place}.queue_size", "no negative number", queue_size)
    about = "whether the raw map is published after each scan; else at `min_update_rate`"
    publish = value("publish_on_update", bool, True, about)
    about = "fields of clouds, or names for the channels of images, that become layers"
    channels = value("channels", list[str], [], about)
    near = value("min_range", float, 0.0, "points nearer to the sensor are dropped [m]")
    far = value("max_range", float, math.inf, "points farther from the sensor are dropped [m]")
    check(0 <= near < far, f"{place}.min_range", "at least 0 and below max_range", near)
    about = "for depth images: every n-th row and column is used"
    stride = value("stride", int, 1, about)
    check(stride >= 1, f"{place}.stride", "at least 1", stride)
    about = "position of the sensor in the frame of the robot [m], where tf does not give it"
    xyz = value("sensor_xyz", list[float], [0.0, 0.0, 0.0], about)
    about = "roll, pitch and yaw of the sensor in that frame [rad], where tf does not give it"
    rpy = value("sensor_rpy", list[float], [0.0, 0.0, 0.0], about)
    for key, numbers in (("sensor_xyz", xyz), ("sensor_rpy", rpy)):
        fits = len(numbers) == 3 and bool(np.isfinite(numbers).all())
        check(fits, f"{place}.{key}", "3 finite numbers", numbers)
    about = "`best_effort` receives from every publisher; `reliable` requests lost messages again"
    reliability = value("reliability", str, "best_effort", about)
    known = ("best_effort", "reliable")
    check(reliability in known, f"{place}.reliability", f"one of {', '.join(known)}", reliability)
    try:
        noise = sensor_processor(processor or default)
    except ConfigError as error:
        raise ConfigError(f"{place}.sensor_processor: {error}") from error
    return InputSource(
        name=name,
        type=kind,
        topic=topic,
        camera_info_topic=info or "".join([*topic.rpartition("/")[:2], "camera_info"]),
        # ROS 1 means by 0 that the queue is unlimited.
        queue_size=queue_size or 100,
        publish_on_update=publish,
        processor=noise,
        channels=tuple(channels),
        min_range=near,
        max_range=far,
        stride=stride,
        sensor=from_xyz_rpy(xyz, rpy),
        is_reliable=reliability == "reliable",
    )


def channel_fusions(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return ways of fusion by patterns, from nested parameters; `default` becomes the last one.

    The dots of patterns, such as `feat_.*`, have nested them.
    """
    found: dict[str, Any] = {}
    for name, value in tree.items():
        inner = channel_fusions(value) if isinstance(value, Mapping) else {"": value}
        found |= {f"{name}.{below}" if below else name: how for below, how in inner.items()}
    if "default" in found:
        found[".*"] = found.pop("default")
    return found


def frame_name(name: str) -> str:
    """Return the name of a frame as tf2 wants it: without the slash that ROS 1 allowed."""
    return name.removeprefix("/")
