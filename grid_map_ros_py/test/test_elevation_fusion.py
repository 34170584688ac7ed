# SPDX-License-Identifier: BSD-3-Clause
"""Scans and pictures of several sensors in one elevation map."""

import math
from typing import Any

import numpy as np
import pytest
from test_cameras import WIDE, looking_down
from test_elevation_parameters import source

from grid_map_core_py import ConfigError, GridGeometry, GridMap, GridMapError
from grid_map_core_py.conversions import color_value_to_vector
from grid_map_core_py.elevation import ElevationMapper
from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py._elevation_mapping.cameras import Picture
from grid_map_ros_py._elevation_mapping.fusion import ElevationFusion
from grid_map_ros_py.nodes._poses import Placement, from_xyz_rpy
from grid_map_ros_py.nodes._scans import Cloud

SECOND = 1_000_000_000
LASER = source({"type": "laser", "min_radius": 0.1})
EXACT = source({"type": "perfect"})


def fusion(parameters: dict[str, Any] | None = None, **options: Any) -> ElevationFusion:
    geometry = GridGeometry(np.array([4.0, 2.0]), 0.5)
    return ElevationFusion(ElevationMapper(geometry, "odom", **(parameters or {})), **options)


def placed(height: float = 1.0, x: float = 0.0, **fields: Any) -> Placement:
    pose = from_xyz_rpy((x, 0, height), (0, 0, 0))
    robot = from_xyz_rpy((x, 0, 0.2), (0, 0, 0))
    return Placement(pose, robot, np.array([x, 0.0]), **fields)


def scan(*points: tuple[float, float, float], seconds: float = 1.0, **columns: Any) -> Cloud:
    arrays = {name: np.array(values) for name, values in columns.items()}
    return Cloud("lidar", round(seconds * SECOND), np.array(points or [(0.1, 0.1, -1.0)]), arrays)


def at(made: ElevationFusion, x: float, y: float, layer: str = "elevation") -> float:
    return float(made.grid_map.at_position(layer, (x, y)))


def test_each_sensor_has_its_own_noise() -> None:
    made = fusion()
    made.fuse(LASER, scan((0.1, 0.1, -1.0), intensity=[7.0]), placed())
    made.fuse(EXACT, scan((1.1, 0.1, -1.5)), placed())
    assert (at(made, 0.1, 0.1), at(made, 1.1, 0.1)) == (0.0, -0.5)
    assert at(made, 0.1, 0.1, "intensity") == 7.0
    assert at(made, 0.1, 0.1, "variance") > 100 * at(made, 1.1, 0.1, "variance")
    assert (made.version, made.warnings) == (2, [])
    assert made.milliseconds["update"][0] > made.milliseconds["fusion"][0] > 0


def test_map_follows_the_robot_if_it_shall() -> None:
    for follow, x in ((True, 1.5), (False, 0.0)):
        made = fusion(follow=follow)
        made.fuse(EXACT, scan(), placed(x=1.4))
        assert made.grid_map.position.tolist() == [x, 0.0]


def test_scale_applies_to_covariances_of_poses() -> None:
    found = []
    for scale in (1.0, 2.0, 0.0):
        made = fusion({"min_variance": 1e-9, "max_variance": 0}, covariance_scale=scale)
        made.fuse(EXACT, scan(), placed(covariance=0.01 * np.eye(6)))
        found.append(at(made, 0.1, 0.1, "variance"))
    assert found[1] == pytest.approx(2 * found[0])
    assert found[0] > 0.01 > 1e-5 > found[2]


def test_heights_are_limited_relative_to_the_robot() -> None:
    # The robot is at 0.2 m, the sensor at 1 m.
    limited = source({"type": "perfect", "ignore_points_above": 0.5, "ignore_points_below": -0.5})
    made = fusion()
    points = [(0.25 + 0.5 * k, 0.1, z) for k, z in enumerate((-0.29, -0.31, -1.29, -1.31))]
    made.fuse(limited, scan(*points), placed())
    found = [at(made, 0.25 + 0.5 * k, 0.1) for k in range(4)]
    np.testing.assert_allclose(found, [math.nan, 0.69, -0.29, math.nan], rtol=1e-6)


def test_ranges_of_a_source_keep_points_and_their_values() -> None:
    made = fusion()
    points = [(0.25 + 0.5 * k, 0.0, 0.0) for k in range(4)]
    near = source({"type": "perfect"}, min_range=0.5, max_range=1.5)
    made.fuse(near, scan(*points, [0.0, math.nan, 1.0], n=[0, 1, 2, 3, 4]), placed())
    found = made.grid_map["n"]
    assert sorted(found[np.isfinite(found)].tolist()) == [1.0, 2.0]
    assert made.report.points_dropped == sum(made.report.reasons.values()) == 3
    reasons = ("nearer than min_range", "farther than max_range")
    assert [made.report.reasons[reason] for reason in reasons] == [1, 1]


def test_scans_out_of_order_by_a_little_keep_the_clock() -> None:
    made = fusion()
    for seconds in (100.0, 98.5, 101.0):
        made.fuse(EXACT, scan(seconds=seconds), placed())
        assert made.grid_map.timestamp >= 100 * SECOND
    assert made.warnings == []
    made.fuse(EXACT, scan(seconds=5.0), placed())
    assert made.grid_map.timestamp == 5 * SECOND
    (text,) = made.warnings
    assert "the map's clock restarts" in text


def test_continuous_cleanup_keeps_the_last_scan_only() -> None:
    made = fusion(clears_before_scan=True)
    made.fuse(EXACT, scan((0.1, 0.1, -1.0)), placed())
    made.fuse(EXACT, scan((1.1, 0.1, -1.0)), placed())
    assert (math.isnan(at(made, 0.1, 0.1)), at(made, 1.1, 0.1)) == (True, 0.0)
    with pytest.raises(GridMapError):
        made.fuse(EXACT, scan((0.1, 0.1, -1.0)), placed(x=1e300))
    assert at(made, 1.1, 0.1) == 0.0


def test_patch_lies_under_the_robot() -> None:
    made = fusion()
    made.lay_patch(from_xyz_rpy((3.0, 0.0, 0.6), (0, 0, 1.0)), (1.0, 2.0), -0.1, 0.004)
    assert made.grid_map.position.tolist() == [3.0, 0.0]
    known = np.isfinite(made.grid_map["elevation"])
    assert known.sum() == 8
    assert at(made, 3.1, 0.9) == pytest.approx(0.5)
    assert at(made, 3.1, 0.9, "variance") == pytest.approx(0.004)


def test_saved_map_is_taken_over_with_its_place() -> None:
    made, other = fusion(), fusion()
    other.fuse(LASER, scan((0.1, 0.1, -1.0)), placed(x=6.0))
    made.fuse(EXACT, scan((0.1, 0.1, 2.0)), placed())
    made.load(other.grid_map)
    assert_maps_equal(
        made.grid_map.without_layers(["time"]), other.grid_map.without_layers(["time"])
    )
    assert made.grid_map.position.tolist() == [6.0, 0.0]


def test_failed_load_leaves_the_map_unchanged() -> None:
    made = fusion()
    for seconds in (1.0, 6.0):
        made.fuse(LASER, scan((0.1 * seconds, 0.1, -1.0), seconds=seconds), placed())
    before, hidden = made.grid_map.copy(), made.mapper._hidden.copy()
    with pytest.raises(GridMapError, match="frame"):
        made.load(GridMap((2, 2), 0.5, position=(1, 0), layers={"elevation": 0}, frame_id="map"))
    assert_maps_equal(made.grid_map, before)
    assert_maps_equal(made.mapper._hidden, hidden)


def test_fused_map_allows_for_horizontal_uncertainty_if_kept() -> None:
    for kept in (False, True):
        made = fusion({"horizontal_variances": kept})
        points = [(x, y, -1.0) for x in np.arange(-1.75, 2, 0.5) for y in (-0.75, -0.25, 0.25)]
        made.fuse(LASER, scan(*points), placed())
        assert (made.fused_map is made.grid_map) != kept
        assert np.isfinite(made.fused_map["elevation"]).sum() == len(points)


# --- pictures -------------------------------------------------------------------------------------


def flat_map() -> ElevationFusion:
    made = fusion(image_fusions={"heat.*": "exponential"})
    made.lay_patch(np.eye(4), (2.0, 2.0), 0.0, 0.01)
    return made


def picture(pixels: Any) -> Picture:
    return Picture("camera", SECOND, pixels, WIDE)


def test_picture_colors_the_cells_that_it_shows() -> None:
    made = flat_map()
    pixels = np.zeros((100, 100, 3), np.uint8)
    pixels[:50, :, 0] = 200
    pixels[50:, :, 2] = 100
    made.paint(source(type="image"), picture(pixels), Placement(looking_down(1.0)))
    colors = color_value_to_vector(made.grid_map["color"])
    x, _ = made.grid_map.axes()
    for row, color in zip(x, colors[:, 1], strict=True):
        if abs(row) > 1:
            assert np.isnan(color).all()
        else:
            expected = (200, 0, 0) if row > 0 else (0, 0, 100)
            np.testing.assert_allclose(255 * color, expected, atol=0.5)


def test_channels_of_a_picture_become_layers() -> None:
    made, camera = flat_map(), source(type="image", channels=["heat", "grass", "road"])
    for value in (1.0, 3.0):
        pixels = np.full((100, 100, 3), value, np.float32)
        made.paint(camera, picture(pixels), Placement(looking_down(1.0)))
    found = [at(made, 0.1, 0.1, name) for name in ("heat", "grass", "road")]
    assert found == [2.0, 3.0, 3.0]
    # Values stay with the cells, also while scans come.
    made.fuse(EXACT, scan((1.6, 0.1, -1.0)), placed(x=0.5))
    assert at(made, 0.1, 0.1, "heat") == 2.0
    gray = np.ones((100, 100, 1), np.uint8)
    made.paint(source(type="image"), picture(gray), Placement(looking_down(1.0)))
    assert at(made, 0.1, 0.1, "gray") == 1.0
    with pytest.raises(GridMapError, match=r"front\.channels: expected 1 names, as the image has"):
        made.paint(camera, picture(gray), Placement(looking_down(1.0)))


@pytest.mark.parametrize(
    "wrong",
    [
        {"covariance_scale": -1.0},
        {"image_fusions": {"a": "mean"}},
        {"image_fusions": {"(": "latest"}},
    ],
)
def test_wrong_settings_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match="expected"):
        fusion(**wrong)
