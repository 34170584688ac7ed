# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The elevation mapping demo: the course of the robot, its report, and all nodes together."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from demos import PACKAGE, parameters
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridGeometry, GridMap, GridMapError
from grid_map_core_py.elevation import ElevationMapper
from grid_map_core_py.simulation import scan
from grid_map_demos_py.elevation_mapping_report_node import (
    compare,
    heights_at,
    person_rows,
)
from grid_map_demos_py.elevation_mapping_robot_node import SENSORS
from grid_map_demos_py.robot_course import (
    DRIFT,
    HEIGHT,
    RobotCourse,
    drifted,
    load_course,
    truth_at,
)
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, from_pose, from_stamp, read_points
from grid_map_ros_py.testing import Process, peer, running_node

DEM = PACKAGE / "data" / "jacksboro_fault_dem.npz"


@pytest.fixture(scope="module")
def course():
    return RobotCourse(load_course(DEM), 0.6)


def test_robot_stands_upright_on_the_ground(course):
    for seconds in np.linspace(0.0, 60.0, 25):
        pose = course.pose_at(seconds)
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
        assert pose[2, 2] > 0.7
        below = course.ground.at_position("elevation", pose[:2, 3])
        assert pose[2, 3] - below == pytest.approx(HEIGHT, abs=0.15)
        ahead = course.pose_at(seconds + 0.1)[:3, 3] - pose[:3, 3]
        assert pose[:3, 0] @ ahead > 0.9 * np.linalg.norm(ahead)
        assert np.linalg.norm(ahead) == pytest.approx(0.06, rel=0.4)


def test_course_has_no_holes_and_one_person_each_lap(course):
    assert np.isfinite(course.ground["elevation"]).all()
    lap = 2.0 * np.pi * np.sqrt(6.0 * 4.5) / course.speed
    times = np.arange(0.0, lap, 0.1)
    places = {seconds: course.person_at(seconds) for seconds in times}
    walk = [seconds for seconds in times if places[seconds] is not None]
    assert 1.0 < walk[0] < walk[-1] < 8.0
    for seconds in walk:
        assert course.person_at(seconds + lap) == pytest.approx(places[seconds])
        assert np.linalg.norm(course.pose_at(seconds)[:2, 3] - places[seconds]) > 1.5
        added = course.terrain_at(seconds)["elevation"] - course.ground["elevation"]
        assert added.max() == pytest.approx(1.7, abs=0.2)
        assert (added > 0).sum() * 0.05**2 == pytest.approx(0.4 * 0.3, rel=0.2)
    lengths = np.linalg.norm(np.diff([places[seconds] for seconds in walk], axis=0), axis=1)
    assert (lengths < 0.14).all()


def test_camera_sees_the_person_for_seconds(course):
    mount, beams, noise = SENSORS["camera"]
    seen = []
    for seconds in np.arange(0.0, 10.0, 0.1):
        terrain, pose = course.terrain_at(seconds), course.pose_at(seconds) @ mount
        heights = terrain["person"][np.isfinite(terrain["person"])]
        if not len(heights):
            continue
        seen.append(seconds)
        points = scan(terrain, beams, pose, sensor=noise, max_range=20.0) @ pose[:3, :3].T
        points += pose[:3, 3]
        points = points[np.abs(points[:, :2] - course.person_at(seconds)).max(axis=1) < 0.25]
        above = points[:, 2] - course.ground.at_position("elevation", points[:, :2])
        assert (above > 0.5).sum() > 10
    assert 3.0 < seen[0] < seen[-1] < 7.0
    np.testing.assert_allclose(np.diff(seen), 0.1)
    assert len(seen) > 15


def test_both_sensors_see_the_ground(course):
    for seconds in (0.0, 20.0, 40.0):
        for mount, beams, noise in SENSORS.values():
            pose = course.pose_at(seconds) @ mount
            points = scan(course.terrain_at(seconds), beams, pose, sensor=noise, max_range=20.0)
            assert np.isfinite(points[:, 0]).mean() > 0.2


def test_configuration_knows_where_the_sensors_are():
    text = (PACKAGE / "config" / "elevation_mapping_demo_mapping.yaml").read_text()
    sources = yaml.safe_load(text)["elevation_mapping"]["ros__parameters"]["input_sources"]
    assert sources.keys() == SENSORS.keys()
    for name, source in sources.items():
        mount = SENSORS[name][0]
        np.testing.assert_allclose(source["sensor_xyz"], mount[:3, 3])
        rotation = Rotation.from_euler("xyz", source["sensor_rpy"]).as_matrix()
        np.testing.assert_allclose(rotation, mount[:3, :3], atol=1e-12)


def test_truth_drifts_with_the_odometry(course):
    pose = course.pose_at(3.0)
    truth = truth_at(course.ground, pose[:2, 3], 4.0, 3.0)
    place = drifted(pose, 3.0)[:3, 3]
    expected = course.ground.at_position("elevation", pose[:2, 3]) + 3.0 * DRIFT[2]
    assert truth.at_position("elevation", place[:2]) == pytest.approx(expected, abs=1e-6)


def test_comparison_finds_offset_error_and_claim():
    truth = GridMap((4.0, 3.0), 0.1, layers={"elevation": 0.5})
    estimate = GridMap((3.0, 3.0), 0.1, layers={"elevation": 0.52, "variance": 1e-4})
    estimate.move((0.3, 0.2))
    estimate["elevation"] = 0.52
    estimate["variance"] = 1e-4
    noise = np.where(np.indices(estimate.size).sum(axis=0) % 2, 0.01, -0.01)
    estimate["elevation"] += noise
    estimate["elevation"][4, 5] = np.nan
    estimate["elevation"][10, 10] = 3.0
    compared, accuracy = compare(estimate, truth)
    assert np.isnan(compared["error"][4, 5])
    # The map reaches over the true terrain by 2 of its 30 columns.
    assert accuracy.known == pytest.approx(28 / 30, abs=0.002)
    assert accuracy.claimed == pytest.approx(0.01)
    assert accuracy.offset == pytest.approx(0.02, abs=0.011)
    assert 0.0 <= accuracy.error < 0.021
    assert accuracy.wrong == pytest.approx(1 / (28 * 30 - 1))
    with pytest.raises(GridMapError, match="expected known cells"):
        compare(estimate, GridMap((1.0, 1.0), 0.1, (90.0, 0.0), {"elevation": 0.0}))


def crossing_maps(delay, behind):
    """Return truths and maps of a person who walks 1 m in 1 s; times are multiples of 0.1 s.

    The map shows a cell from `delay` after the arrival of the person to `behind` after the leaving.
    """
    truths, estimates = [], []
    for step in range(40):
        truth = GridMap((4.0, 2.0), 0.1, layers={"elevation": 0.3, "person": np.nan})
        estimate = GridMap((3.0, 3.0), 0.1, layers={"elevation": 0.3})
        truth.timestamp = estimate.timestamp = 10**9 + step * 10**8
        estimate.move((0.02 * step, 0.0))
        estimate["elevation"] = 0.3
        for x in range(10, 20):  # The person is on cell x from step x to x + 1.
            if x <= step <= x + 1:
                truth["person"][x, 10], truth["elevation"][x, 10] = 1.7, 2.0
            if x + delay <= step <= x + 1 + behind:
                at = truth.get_position((x, 10))
                estimate["elevation"][estimate.get_index(at)] = 1.2
        truths.append(truth)
        estimates.append(estimate)
    return truths, estimates


@pytest.mark.parametrize(
    ("delay", "behind", "expected"),
    [
        (0, 0, ["2.0 to 3.0 s", "2.0 to 3.0 s", "11 of 11, up to 0.1 s apart", "up to 0, 0.0"]),
        (1, 4, ["2.0 to 3.0 s", "2.1 to 3.4 s", "10 of 11, up to 0.1 s apart", "up to 4, 0.4"]),
        (3, 5, ["2.0 to 3.0 s", "2.3 to 3.5 s", "0 of 11, up to 0.1 s apart", "up to 4, 0.5"]),
        (9, 0, ["2.0 to 3.0 s", "never", "0 of 11, up to 0.1 s apart", "up to 0, 0.0"]),
    ],
)
def test_rows_say_when_maps_show_the_person(delay, behind, expected):
    rows = list(person_rows(*crossing_maps(delay, behind), 0).values())
    assert rows[:3] == expected[:3]
    assert rows[3].replace("high for up to ", "") == expected[3] + " s"


def test_rows_say_that_there_is_no_person():
    truths, estimates = crossing_maps(0, 0)
    rows = person_rows(truths[:5], estimates[:1], 0)
    assert rows["in the camera's view"] == rows["in the map"] == "never"


def assert_map_shows_the_person(rows):
    """Fail unless the person enters within 0.5 s and leaves within 1.5 s.

    Each limit grows by the longest time between maps, which is long on a busy computer, and that of
    leaving by 1 s: a single cell may wait for a beam.
    """
    seen, shown, counts, behind = (
        [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", rows[name])]
        for name in (
            "in the camera's view",
            "in the map",
            "maps that show it in view",
            "cells left behind",
        )
    )
    showing, maps, gap = counts
    assert shown[0] <= seen[0] + 0.5 + gap
    assert shown[1] <= seen[1] + 2.5 + gap
    assert maps > 0
    assert showing >= 0.8 * maps
    assert behind[1] <= 2.5 + gap


def test_person_enters_a_map_that_knows_the_ground(course):
    mapper, random = ElevationMapper(GridGeometry((10.0, 10.0), 0.05)), np.random.default_rng(1)
    truths, estimates = [], []
    for step in range(0, 90, 2):
        pose, terrain = course.pose_at(0.1 * step), course.terrain_at(0.1 * step)
        for mount, beams, noise in SENSORS.values():
            points = scan(terrain, beams, pose @ mount, sensor=noise, random=random, max_range=20.0)
            mapper.update(
                points,
                pose @ mount,
                timestamp=step * 10**8,
                position=pose[:2, 3],
                sensor=noise,
            )
        terrain.timestamp = step * 10**8
        truths.append(terrain)
        estimates.append(mapper.grid_map.copy())
    # The ground under the person 0.8 s before.
    known = []
    for truth, estimate in zip(truths[4:], estimates, strict=False):
        places = truth.get_positions(np.nonzero(np.isfinite(truth["person"])))
        known.extend(np.isfinite(heights_at(estimate, places, "nearest")))
    assert np.mean(known) > 0.8
    assert_map_shows_the_person(person_rows(truths, estimates, 0))


def test_robot_publishes_clouds_odometry_and_truth():
    topics = {"/lidar_points": PointCloud2, "/camera_points": PointCloud2}
    topics |= {"/odom": Odometry, "/true_terrain": GridMapMessage}
    with peer() as other:
        for topic, kind in topics.items():
            other.listen(topic, kind, 10)
        module = "grid_map_demos_py.elevation_mapping_robot_node"
        with running_node(module, *parameters("rate:=5.0")):
            # More than the first ones, of which odometry has no variance yet.
            got = {topic: other.expect(topic, 4) for topic in topics}
    for name in ("lidar", "camera"):
        cloud = got[f"/{name}_points"]
        assert cloud.header.frame_id == name
        points = np.column_stack([read_points(cloud)[axis] for axis in "xyz"])
        assert len(points) > 1000
        assert np.isfinite(points).all()
    odometry = got["/odom"]
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert np.diag(np.reshape(odometry.pose.covariance, (6, 6))).min() > 0
    truth = from_message(got["/true_terrain"])
    assert truth.frame_id == "odom"
    assert from_stamp(odometry.header.stamp) > 0
    place = from_pose(odometry)[:3, 3]
    assert place[2] - truth.at_position("elevation", place[:2]) == pytest.approx(HEIGHT, abs=0.2)


def test_demo_maps_the_terrain_and_reports_its_errors(tmp_path):
    command = [sys.executable, "-m", "grid_map_demos_py.elevation_mapping_demo"]
    demo = Process([*command, "--report", str(tmp_path)])
    assert demo.wait(100) == 0, demo.text
    names = {"truth", "estimate", "error", "deviation", "traversability"}
    assert {path.stem for path in tmp_path.iterdir()} == names
    assert all(path.stat().st_size > 10_000 for path in Path(tmp_path).iterdir())
    rows = dict(re.findall(r"^ +(.+?) {2,}(.+)$", demo.text, re.MULTILINE))
    values = {name: text.split()[0] for name, text in rows.items()}
    assert float(values["known"]) > 30
    assert float(values["68 % of the errors below"]) < 40
    assert float(values["errors above 10 cm"]) < 15
    assert abs(float(values["offset of the map"])) < 60
    assert_map_shows_the_person(rows)
