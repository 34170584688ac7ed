# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of input sources and their sensor models.

The parameters have the names of `elevation_mapping` (ROS 1). Parameters of channels have the names
of `elevation_mapping_cupy`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

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
from grid_map_core_py.elevation._state import is_value_name
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check

MODELS: Mapping[str, type[SensorModel]] = {
    "laser": LaserModel,
    "structured_light": StructuredLightModel,
    "stereo": StereoModel,
    "perfect": PerfectModel,
    "constant": ConstantModel,
}
"""Classes of sensor models, by the value of the parameter `type`."""

_OLD_MODELS = {
    "Laser": "laser",
    "StructuredLight": "structured_light",
    "Stereo": "stereo",
    "Perfect": "perfect",
}
"""Values of `type`, by the names that C++ versions before 0.7 use in parameter files."""

_UNUSED = {
    "apply_voxelgrid_filter": "all points are fused",
    "voxelgrid_filter_size": "all points are fused",
    **dict.fromkeys(("factor_a", "factor_b", "factor_c"), "C++ reads normal_factor_a, _b and _c"),
    **dict.fromkeys(("p_2", "p_3", "p_4", "p_5"), "the stereo model has no terms of pixels"),
}
"""Sensor processor parameters of the C++ package that have no effect here, and the reasons."""

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
"""Node parameters of the C++ package that have no effect here, and the reasons."""


@dataclass(frozen=True)
class SensorProcessor:
    """Noise model of a sensor, and height limits for its points.

    Attributes:
        above, below: height above or below which points are ignored, relative to the robot [m].
        unused: parameters that have no effect, with the reasons.
    """

    model: SensorModel
    above: float = math.inf
    below: float = -math.inf
    unused: tuple[str, ...] = ()


def sensor_processor(parameters: Mapping[str, Any]) -> SensorProcessor:
    """Create a sensor processor from its `type`, height limits, and model parameters."""
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
    """Translate parameters of the C++ package to parameters of `StereoModel`.

    In C++, if p_2 to p_5 are zero, the standard deviation of the depth z is
    sqrt(p_1) z^2 / depth_to_disparity_factor.
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


@dataclass(frozen=True, kw_only=True)
class SourceSettings:
    """Parameters of one source of scans or images in `input_sources`.

    Attributes:
        type: kind of sensor data on the topic.
        topic: topic of the clouds or images.
        camera_info_topic: topic of the `CameraInfo`; empty means `camera_info` in the namespace of
            `topic`.
        queue_size: maximum number of waiting messages; 0 means 100.
        publish_on_update: publish the raw map after each scan.
        channels: cloud fields or image channels that become layers.
        min_range: distance from the sensor below which points are ignored [m].
        max_range: distance from the sensor above which points are ignored [m].
        stride: sampling step of depth images [pixels]; 1 uses every row and column.
        sensor_xyz: position of the sensor on the robot [m]; unused with tf.
        sensor_rpy: roll, pitch and yaw of the sensor on the robot [rad]; unused with tf.
        reliability: `best_effort` works with every publisher; `reliable` recovers lost messages,
            but needs a reliable publisher.
    """

    type: Literal["pointcloud", "depth_image", "image"] = "pointcloud"
    topic: str = ""
    camera_info_topic: str = ""
    queue_size: int = 10
    publish_on_update: bool = True
    channels: list[str] = field(default_factory=list)
    min_range: float = 0.0
    max_range: float = math.inf
    stride: int = 1
    sensor_xyz: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    sensor_rpy: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    reliability: Literal["best_effort", "reliable"] = "best_effort"

    def __post_init__(self) -> None:
        check(self.topic != "", "topic", "the name of a topic", self.topic)
        check(self.queue_size >= 0, "queue_size", "no negative number", self.queue_size)
        fits = 0 <= self.min_range < self.max_range
        check(fits, "min_range", "at least 0 and below max_range", self.min_range)
        fits = all(map(is_value_name, self.channels))
        check(fits, "channels", "layer names that the mapper does not use", self.channels)
        check(self.stride >= 1, "stride", "at least 1", self.stride)
        for name in ("sensor_xyz", "sensor_rpy"):
            numbers = getattr(self, name)
            fits = len(numbers) == 3 and bool(np.isfinite(numbers).all())
            check(fits, name, "3 finite numbers", numbers)


@dataclass(frozen=True)
class InputSource:
    """A source of scans or images: its name, its parameters, and the noise model of its sensor."""

    name: str
    settings: SourceSettings
    processor: SensorProcessor

    @property
    def camera_info_topic(self) -> str:
        beside = "".join([*self.settings.topic.rpartition("/")[:2], "camera_info"])
        return self.settings.camera_info_topic or beside

    @property
    def queue_size(self) -> int:
        """Maximum number of waiting messages; 0 (no limit in ROS 1) is replaced by 100."""
        return self.settings.queue_size or 100


def channel_fusions(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fusion methods of channels by name pattern.

    ROS splits patterns such as `feat_.*` at the dots; this function joins the parts again. The
    entry `default` becomes the last pattern, `.*`.
    """
    found: dict[str, Any] = {}
    for name, value in tree.items():
        inner = channel_fusions(value) if isinstance(value, Mapping) else {"": value}
        found |= {f"{name}.{below}" if below else name: how for below, how in inner.items()}
    if "default" in found:
        found[".*"] = found.pop("default")
    return found
