# SPDX-License-Identifier: BSD-3-Clause
"""The demo of planar regions: the course, the report, and all nodes together."""

import re
import sys

import numpy as np
import pytest

from grid_map_core_py.planes import extract_planes
from grid_map_demos_py.report_node import found_planes
from grid_map_demos_py.steps_course import PLANES, make_course, pose_at
from grid_map_ros_py.testing import Process, wait_until


def counts(rows: dict[str, str]) -> dict[str, int]:
    """Return the number of planes that have regions; their heights must be exact."""
    found = {}
    for name, text in rows.items():
        count, total, error = re.fullmatch(r"(\d+) of (\d+), heights within (.+) mm", text).groups()
        assert int(total) == len(PLANES[name])
        assert float(error) < 1.0
        found[name] = int(count)
    return found


def test_course_has_all_planes():
    course = make_course()
    regions = extract_planes(course)
    course = course.with_layers(regions.layers())
    assert counts(found_planes(course, course)) == {"treads": 5, "ramp": 1, "stones": 9}
    tops = course.at_position("elevation", np.array(PLANES["treads"]))
    np.testing.assert_allclose(np.diff(tops), 0.17, atol=1e-6)
    assert regions.at(PLANES["ramp"][0]).normal[0] == pytest.approx(0.36, abs=0.02)


def test_camera_looks_ahead_and_down():
    pose = pose_at(1.5)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    np.testing.assert_allclose(pose @ (0.0, 0.0, 2.0, 1.0), (2.5, 0.0, 2.2 - 3**0.5, 1.0))


def test_missing_and_merged_regions_are_not_counted():
    course = make_course()
    layers = extract_planes(course).layers()
    merged = layers["plane_id"].copy(order="F")
    merged[merged > 0] = 7.0
    found = found_planes(course.with_layers({**layers, "plane_id": merged}), course)
    assert counts(found) == {"treads": 1, "ramp": 0, "stones": 0}
    merged[...] = 0.0
    missing = found_planes(course.with_layers({**layers, "plane_id": merged}), course)
    assert missing == {"treads": "0 of 5", "ramp": "0 of 1", "stones": "0 of 9"}


def test_demo_finds_all_treads_stones_and_the_ramp(tmp_path):
    command = [sys.executable, "-m", "grid_map_demos_py.launcher", "planar_regions_demo"]
    demo = Process([*command, "--report", str(tmp_path)])
    try:
        wait_until(lambda: not demo.is_running, "the end of the demo")
    finally:
        demo.stop()
    assert demo.returncode == 0, demo.text
    assert "Traceback" not in demo.text, demo.text
    found = re.findall(
        r"^ +(treads|ramp|stones) +(\d+) of (\d+), heights within ([\d.]+) mm",
        demo.text,
        re.MULTILINE,
    )
    numbers = {name: (int(count), int(total)) for name, count, total, _ in found}
    assert numbers == {"treads": (5, 5), "ramp": (1, 1), "stones": (9, 9)}
    assert all(float(error) < 15.0 for *_, error in found)
    assert [path.name for path in tmp_path.iterdir()] == ["planar_regions.png"]
    assert (tmp_path / "planar_regions.png").stat().st_size > 20_000
