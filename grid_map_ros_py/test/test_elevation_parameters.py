# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of sensors, also in the forms of the C++ package."""

import math
from typing import Any

import numpy as np
import pytest

from grid_map_core_py import ConfigError
from grid_map_core_py._parameters import build
from grid_map_core_py.elevation import LaserModel, StereoModel, StructuredLightModel
from grid_map_core_py.elevation._parameters import Parameters
from grid_map_ros_py._elevation_mapping.settings import Settings, read_mapper_parameters
from grid_map_ros_py._elevation_mapping.sources import (
    InputSource,
    SourceSettings,
    channel_fusions,
    sensor_processor,
)
from grid_map_ros_py.testing import peer


def source(processor: dict[str, Any] | None = None, **given: Any) -> InputSource:
    settings = build(SourceSettings, {"topic": "/points", **given})
    return InputSource("front", settings, sensor_processor(processor or {"type": "perfect"}))


def test_sensor_of_cpp_file_is_read() -> None:
    given = {
        "type": "structured_light",
        "cutoff_min_depth": 0.35,
        "cutoff_max_depth": 3,
        "normal_factor_a": 0.00241809,
        "ignore_points_above": 0.5,
        "apply_voxelgrid_filter": True,
        "factor_a": 0.000181,
    }
    found = sensor_processor(given)
    model = StructuredLightModel(
        cutoff_min_depth=0.35, cutoff_max_depth=3.0, normal_factor_a=0.00241809
    )
    assert (found.model, found.above, found.below) == (model, 0.5, -math.inf)
    reason = "C++ reads normal_factor_a, _b and _c"
    unused = ("apply_voxelgrid_filter: all points are fused", f"factor_a: {reason}")
    assert found.unused == unused
    assert sensor_processor({"type": "Laser"}).model == LaserModel()


def test_stereo_factors_of_cpp_give_the_same_deviation() -> None:
    given = {"type": "stereo", "p_1": 0.04, "p_3": 1.0, "depth_to_disparity_factor": 38.6}
    model = sensor_processor({**given, "lateral_factor": 0.0}).model
    assert isinstance(model, StereoModel)
    points = np.array([[0.0], [0.0], [3.0]])
    variances = model.vertical_variances(points, np.array([3.0]), np.array([0.0, 0.0, 1.0]))
    disparity = 38.6 / 3.0
    assert variances[0] == pytest.approx((38.6 / disparity**2) ** 2 * 0.04)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"type": "sonar"}, "'type': expected one of laser, structured_light, stereo, perfect,"),
        ({"type": 3}, "'type': expected a string"),
        ({"min_radius": -1.0}, "'min_radius': expected no negative number"),
        ({"type": "stereo", "p_1": -1.0}, "'p_1': expected no negative number"),
        ({"type": "stereo", "cutoff_min_depth": 1.0}, "set min_range and max_range"),
        ({"ignore_points_above": "high"}, "'ignore_points_above': expected a number"),
    ],
)
def test_wrong_sensor_is_refused(given: dict[str, Any], reason: str) -> None:
    with pytest.raises(ConfigError) as caught:
        source(given)
    assert reason in str(caught.value)


def test_source_has_the_defaults_of_ros_1() -> None:
    assert source().queue_size == 10
    assert source(queue_size=0).queue_size == 100
    assert source(topic="/front/depth/image").camera_info_topic == "/front/depth/camera_info"
    assert source(camera_info_topic="/info").camera_info_topic == "/info"
    assert source(topic="depth").camera_info_topic == "camera_info"


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"type": "sonar"}, "type': expected one of 'pointcloud', 'depth_image', 'image'"),
        ({"topic": ""}, "topic': expected the name of a topic"),
        ({"queue_size": -1}, "queue_size': expected no negative number"),
        ({"min_range": 2.0, "max_range": 1.0}, "min_range': expected at least 0 and below"),
        ({"channels": ["gray", "elevation"]}, "channels': expected layer names that the mapper"),
        ({"channels": [""]}, "channels': expected layer names that the mapper"),
        ({"stride": 0}, "stride': expected at least 1"),
        ({"sensor_xyz": [1.0]}, "sensor_xyz': expected 3 finite numbers"),
        ({"sensor_rpy": [0.0, 0.0, math.nan]}, "sensor_rpy': expected 3 finite numbers"),
        ({"reliability": "good"}, "reliability': expected one of 'best_effort', 'reliable'"),
    ],
)
def test_wrong_source_is_refused(given: dict[str, Any], reason: str) -> None:
    with pytest.raises(ConfigError) as caught:
        source(**given)
    assert f"parameter '{reason}" in str(caught.value)


def test_patterns_of_channels_keep_their_dots_and_order() -> None:
    tree = {"default": "average", "rgb": "color", "feat_": {"*": "max", "[ab]": {"c": "latest"}}}
    expected = {"rgb": "color", "feat_.*": "max", "feat_.[ab].c": "latest", ".*": "average"}
    assert list(channel_fusions(tree).items()) == list(expected.items())


def test_rate_of_zero_disables_visibility_cleanup_for_good() -> None:
    with peer() as other:
        for _ in ("start", "reload_parameters"):
            found = read_mapper_parameters(other.node, Settings(visibility_cleanup_rate=0.0))
            assert not found["enable_visibility_cleanup"]
    assert Parameters().enable_visibility_cleanup
