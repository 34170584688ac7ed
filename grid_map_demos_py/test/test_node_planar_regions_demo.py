# SPDX-License-Identifier: BSD-3-Clause
"""The demo of planar regions: the course, the report, and all nodes together."""

import re
import sys

import numpy as np
import pytest

from grid_map_core_py.planes import extract_planes
from grid_map_demos_py.report_node import found_planes
from grid_map_demos_py.steps_course import PLANES, make_course
from grid_map_ros_py.testing import Process, wait_until


def counts(rows: dict[str, str], tolerance: float = 1.0) -> dict[str, int]:
    """Return the number of planes that have regions, at heights within a tolerance [mm]."""
    found = {}
    for name, text in rows.items():
        count, total, error = re.fullmatch(r"(\d+) of (\d+), heights within (.+) mm", text).groups()
        assert int(total) == len(PLANES[name])
        assert float(error) < tolerance
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
    rows = dict(re.findall(r"^ +(treads|ramp|stones) +(.+)$", demo.text, re.MULTILINE))
    assert counts(rows, 15.0) == {"treads": 5, "ramp": 1, "stones": 9}
    assert [path.name for path in tmp_path.iterdir()] == ["planar_regions.png"]
    assert (tmp_path / "planar_regions.png").stat().st_size > 20_000
