# SPDX-License-Identifier: BSD-3-Clause
"""The elevation mapping demo: the robot course, the report, and all nodes together."""

import re
import sys

import numpy as np
import pytest
import yaml
from demos import DATA, PACKAGE, parameters
from nav_msgs.msg import Odometry
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridMap, GridMapError
from grid_map_core_py.simulation import scan
from grid_map_demos_py.report_node import compare, person_rows
from grid_map_demos_py.robot_course import (
    DRIFT,
    HEIGHT,
    RADII,
    SENSORS,
    RobotCourse,
    drifted,
    load_course,
    truth_at,
)
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, from_pose, from_stamp, read_points
from grid_map_ros_py.testing import Process, peer, running_node


@pytest.fixture(scope="module")
def course():
    return RobotCourse(load_course(DATA / "jacksboro_fault_dem.npz"), 0.6)


def test_robot_stands_upright_on_the_ground(course):
    assert np.isfinite(course.ground["elevation"]).all()
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


def test_camera_sees_a_person_cross_the_way(course):
    mount, beams, noise = SENSORS["camera"]
    sides = []
    for seconds in np.linspace(4.6, 6.9, 9):
        terrain, pose = course.terrain_at(seconds), course.pose_at(seconds) @ mount
        cells = np.nonzero(np.isfinite(terrain["person"]))
        assert len(cells[0]) * 0.05**2 == pytest.approx(0.4 * 0.3, rel=0.2)
        assert terrain["person"][cells] == pytest.approx(1.7, abs=0.2)
        place = terrain.get_positions(cells).mean(axis=0)
        sides.append(np.linalg.norm(place / RADII) - 1.0)
        points = scan(terrain, beams, pose, sensor=noise, max_range=20.0) @ pose[:3, :3].T
        points += pose[:3, 3]
        points = points[np.abs(points[:, :2] - place).max(axis=1) < 0.25]
        above = points[:, 2] - course.ground.at_position("elevation", points[:, :2])
        assert (above > 0.5).sum() > 10
    assert sides[-1] < 0.0 < sides[0]
    assert np.isnan(course.terrain_at(4.0)["person"]).all()


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
    even, cells = accuracy["Cells without edges"], accuracy["All cells"]
    assert (cells["known"], cells["errors above 10 cm"]) == ("93 %", "0.1 %")
    assert even["claimed standard deviation"] == "10.0 mm"
    assert numbers(even["offset of the map"])[0] == pytest.approx(20, abs=11)
    assert numbers(even["68 % of the errors below"])[0] < 21
    with pytest.raises(GridMapError, match="expected known cells"):
        compare(estimate, GridMap((1.0, 1.0), 0.1, (90.0, 0.0), {"elevation": 0.0}))


def crossing_maps(delay, behind):
    """Return truths and maps of a person who is in cell x (of 10) from step 10 + x to 11 + x.

    Steps are 0.1 s apart. A cell is high in the maps from `delay` steps after the person arrives
    until `behind` steps after the person leaves.
    """
    truths, estimates = [], []
    for step in range(40):
        truth = GridMap((4.0, 2.0), 0.1, layers={"elevation": 0.3, "person": np.nan})
        estimate = GridMap((3.0, 3.0), 0.1, (0.1 * (step // 5), 0.0), {"elevation": 0.3})
        truth.timestamp = estimate.timestamp = step * 10**8
        for x in range(10):
            place = truth.get_position((15 + x, 10))
            if 0 <= step - 10 - x <= 1:
                truth["person"][15 + x, 10], truth["elevation"][15 + x, 10] = 1.7, 2.0
            if delay <= step - 10 - x <= 1 + behind:
                estimate["elevation"][estimate.get_index(place)] = 1.2
        truths.append(truth)
        estimates.append(estimate)
    return truths, estimates


@pytest.mark.parametrize(
    ("delay", "behind", "shown", "left"),
    [(0, 0, "1.0 to 2.0 s", 0.0), (3, 5, "1.3 to 2.5 s", 0.5), (9, 0, "never", 0.0)],
)
def test_rows_say_when_maps_show_the_person(delay, behind, shown, left):
    truths, estimates = crossing_maps(delay, behind)
    assert list(person_rows(truths, estimates, 0).values()) == [
        "1.0 to 2.0 s",
        f"{shown}, maps up to 0.1 s apart",
        f"high for up to {left} s",
    ]
    assert person_rows(truths[:5], estimates[:1], 0)["on the terrain"] == "never"


def test_robot_publishes_clouds_odometry_and_truth():
    topics = {"/lidar_points": PointCloud2, "/camera_points": PointCloud2}
    topics |= {"/odom": Odometry, "/true_terrain": GridMapMessage}
    with peer() as other:
        for topic, kind in topics.items():
            other.listen(topic, kind, 10)
        module = "grid_map_demos_py.elevation_mapping_robot_node"
        with running_node(module, *parameters("rate:=5.0")):
            # The first odometry has no variance yet.
            got = {topic: other.expect(topic, 3) for topic in topics}
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
    command = [sys.executable, "-m", "grid_map_demos_py.launcher", "elevation_mapping_demo"]
    demo = Process([*command, "--report", str(tmp_path)])
    assert demo.wait(100) == 0, demo.text
    assert "[ERROR]" not in demo.text
    names = {"truth", "estimate", "error", "deviation", "traversability"}
    assert {path.stem for path in tmp_path.iterdir()} == names
    assert all(path.stat().st_size > 10_000 for path in tmp_path.iterdir())
    rows = dict(re.findall(r"^ +(.+?) {2,}(.+)$", demo.text, re.MULTILINE))
    values = {name: text.split()[0] for name, text in rows.items()}
    assert float(values["known"]) > 0
    assert float(values["68 % of the errors below"]) < 40
    assert float(values["errors above 10 cm"]) < 15
    assert abs(float(values["offset of the map"])) < 60
    assert {"on the terrain", "in the map", "cells left behind"} <= rows.keys()


def numbers(text):
    return [float(number) for number in re.findall(r"[\d.]+", text)]
