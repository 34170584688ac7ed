# SPDX-License-Identifier: BSD-3-Clause
"""The large map demo: the site, the robot, and the report on map windows."""

import re
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from demos import PACKAGE, parameters
from nav_msgs.msg import Odometry

from grid_map_core_py import GridMap
from grid_map_core_py.tiled import open_map
from grid_map_demos_py.large_map_robot_node import position_at
from grid_map_demos_py.large_site import CORRIDOR, END, GEOMETRY, LAYER, ground, make_site, way_at
from grid_map_ros_py.testing import peer, running_node, start_node

pytestmark = pytest.mark.needs("xarray", "zarr")


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """Return a store with only the first chunks, at the start of the path."""
    path = tmp_path_factory.mktemp("large") / "site.zarr"
    assert len([*islice(make_site(path), 12)]) == 12
    return path


def test_ground_has_no_seams_and_is_known_along_the_way(site):
    tiled = open_map(site)
    assert tiled.size[0] * tiled.size[1] > 10**9
    for x in (END, END - 51.2, END - 200.0):
        found = tiled.get_submap((x, way_at(x)), (20.0, 20.0))
        assert np.isfinite(found[LAYER]).all()
        # Sums of float32 products, over a different number of columns.
        np.testing.assert_allclose(found[LAYER], ground(found.geometry), atol=1e-3)
        assert found[LAYER].std() > 0.1
        far = tiled.get_submap((x, way_at(x) + CORRIDOR + 60.0), (20.0, 20.0))
        assert np.isnan(far[LAYER]).all()
    assert sum(file.stat().st_size for file in site.rglob("*") if file.is_file()) < 30e6


def test_robot_drives_to_and_fro_along_the_way():
    assert position_at(0.0)[0] == END
    assert position_at(2 * END)[0] == -END
    assert position_at(4 * END)[0] == pytest.approx(END)
    x, y = position_at(2 * END + 300.0)
    assert (x, y) == (pytest.approx(300.0 - END), way_at(x))
    assert GridMap.from_geometry(GEOMETRY).is_inside([x, y])


def test_report_measures_windows_of_the_node(site, tmp_path):
    file = str(PACKAGE / "config" / "large_map_demo_window.yaml")
    window = ["--ros-args", "--params-file", file, "-p", f"source:={site}"]
    robot = parameters("speed:=30.0")
    options = parameters("duration:=2.0", f"output_directory:={tmp_path}")
    with (
        peer() as other,
        running_node("grid_map_ros_py._executables.grid_map_window", *window),
        running_node("grid_map_demos_py.large_map_robot_node", *robot),
    ):
        other.listen("/odom", Odometry, 10)
        message = other.expect("/odom")
        assert (message.header.frame_id, message.child_frame_id) == ("map", "base_link")
        place = message.pose.pose.position
        assert place.y == way_at(place.x)
        report = start_node("grid_map_demos_py.report_node", "large_map", *options)
        try:
            assert report.wait(100) == 0, report.text
        finally:
            report.stop()
    assert {path.stem for path in tmp_path.iterdir()} == {"way", "window"}
    values = dict(re.findall(r"^ +(.+?) {2,}(-?[\d.]+)(?: ms| MB| Hz)$", report.text, re.MULTILINE))
    for name in ("rate", "median", "worst", "at the start", "at the end"):
        assert float(values[name]) > 0
