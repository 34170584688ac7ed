# SPDX-License-Identifier: BSD-3-Clause
"""Invalid parameters end every node with one message."""

import re
import subprocess
import sys

import pytest
from bags import DATA
from sites import make_site

from conftest import arguments
from grid_map_ros_py.nodes._poses import has_tf
from grid_map_ros_py.testing import refusals

BAG = DATA / "cpp_move_mcap" / "cpp_move_mcap_0.mcap"

REFUSED = {
    "elevation_mapping": [
        ({"resolution": 0.0}, "resolution"),
        ({"length_in_x": 1e4, "length_in_y": 9.0}, "length_in_x, length_in_y: expected at most"),
        ({"max_variance": 1e-9}, "'max_variance': expected at least min_variance, or 0, got 1e-09"),
        ({"sensor_processor.type": "sonar"}, "input_sources.points.sensor_processor: parameter"),
        (
            {"input_sources.a.topic": "/a", "input_sources.a.type": "b"},
            "'input_sources.a.type': expected one of 'poi",
        ),
        (
            {"input_sources.a.topic": "/a", "input_sources.b.topic": "a"},
            "'input_sources.b.topic': expected another topic than that of input_sources.a, got 'a'",
        ),
        ({"input_sources": 3}, "'input_sources': expected parameters below it, got 3 (int)"),
        ({"pose_source": "topic", "pose_type": "gps"}, "'pose_type': expected one of 'odometry',"),
        ({"directory": "/no/such/directory"}, "'directory': expected a directory that exists"),
        ({"postprocessor_pipeline.filter2.name": "a"}, "filters: filter1 is missing before filt"),
        *([] if has_tf() else [({"pose_source": "tf"}, "'tf' needs the package 'tf2_ros'")]),
    ],
    "grid_map_loader": [
        ({"file_path": "cut_off.mcap"}, "is cut off"),
        ({"file_path": BAG, "max_cells": 9}, "on /grid_map: info: expected at most 9 cells"),
        ({"file_path": BAG, "max_cells": 0}, "'max_cells': expected a finite number of at least 1"),
    ],
    "grid_map_saver": [
        ({"file_path": "."}, "is not a bag and is not replaced; it holds cut_off.mcap"),
        ({}, "parameter 'file_path'"),
    ],
    "grid_map_server": [
        ({"file_path": "/no/such/bag"}, "/no/such/bag"),
        ({"directory": "/no/such/directory"}, "'directory': expected a directory that exists"),
        ({"input_topic": "/grid_map"}, "input_topic and output_topic are both '/grid_map'"),
        ({"source": "/no/site.zarr"}, "/no/site.zarr: cannot be read"),
        ({"source": "/no/site.zarr", "origin": "[48.1]"}, "'origin': expected a latitude and a lo"),
        ({"source": 3}, "'source': expected a string or a list, each item a string, got 3 (int)"),
    ],
    "grid_map_window": [
        ({}, "parameter 'source': expected a Zarr store or a GeoTIFF file, got ''"),
        ({"source": "/no/site.zarr"}, "/no/site.zarr: cannot be read"),
        ({"source": "site.zarr", "length": 1e4}, "length: expected at most 16000000 cells, got"),
        ({"source": "site.zarr", "layers": "[slope]"}, "no layer 'slope'; available: elevation,"),
        ({"source": "site.zarr", "step": -1.0}, "'step': expected a number from 0 to 1e+09"),
        ({"source": "site.zarr", "pose_source": "none"}, "expected one of auto, tf, odometry,"),
        (
            {"source": "site.zarr", "write_back": True, "write_topic": "/grid_map"},
            "write_topic and output_topic are both '/grid_map'",
        ),
    ],
    "octomap_to_grid_map": [
        ({"resolution": -0.5}, "parameter 'resolution': expected a number from 0 to 1e+30, got"),
        ({"min_x": 5.0, "max_x": 1.0}, "parameter 'max_x': expected at least min_x, 5, got 1.0"),
    ],
    "path_planner": [
        ({"cost_layer": "''", "elevation_layer": "''"}, "'elevation_layer': expected a layer, as"),
        ({"elevation_layer": "''", "max_step": 0.1}, "'elevation_layer': expected a layer, as"),
        ({"footprint": "'[[0.1, 0.2]]'"}, "'footprint': expected corners [x, y] [m] in order"),
        ({"robot_radius": 1e-7}, "'robot_radius': expected 0, or a length > 1e-06 [m], got 1e-07"),
        ({"neighbors": 4}, "parameter 'neighbors': expected one of 8, 16, got 4 (int)"),
        ({"max_slope_up": 25.0}, "'max_slope_up': expected radians from 0 to pi / 2, got 25.0"),
    ],
    "planar_regions": [
        ({"grid_map_topic": "a b"}, "'grid_map_topic': expected the name of a topic, got 'a b'"),
        ({"contour_extraction.marginSize": -1}, "contour_extraction: parameter 'marginSize': exp"),
        ({"height_layer": "''"}, "parameter 'height_layer': expected the name of a layer, got"),
    ],
    "point_cloud_to_grid_map": [
        ({"pose_source": "gps"}, "'pose_source': expected one of 'auto', 'tf', 'od"),
        ({"pose_source": "none"}, "'robot_centric': expected false without poses"),
        ({"length": [1.0]}, "'length': expected 2 finite numbers, got [1.0]"),
        ({"length": [1e4, 1e4]}, "length: expected at most 16000000 cells, got 100000 x 100000"),
        ({"input_reliability": "perfect"}, "expected one of 'best_effort', 'reliable', got"),
        ({"publish_rate": -1.0}, "'publish_rate': expected 0, or a number from 1e-09 to"),
        *([] if has_tf() else [({"pose_source": "tf"}, "'tf' needs the package 'tf2_ros'")]),
    ],
}


WINDOW = "grid_map_window"


def start_of(executable: str, parameters: dict[str, object]) -> tuple[str, list[str]]:
    """Return the function that starts an executable, and its arguments."""
    room = f"grid_map_ros_py._executables.{executable}"
    # The error must not depend on whether tf is installed.
    has_poses = executable in (WINDOW, "point_cloud_to_grid_map")
    given = {"pose_source": "odometry", **parameters} if has_poses else parameters
    return f"{room}:{executable.title().replace('_', '')}Node.main", arguments(**given)


@pytest.mark.parametrize(
    "executables",
    [
        pytest.param(REFUSED.keys() - {WINDOW}, id="others"),
        pytest.param({WINDOW}, id=WINDOW, marks=pytest.mark.needs("xarray", "zarr")),
    ],
)
def test_invalid_parameters_end_the_node_with_one_message(
    tmp_path, monkeypatch, executables: set[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cut_off.mcap").write_bytes(BAG.read_bytes()[:-50])
    if WINDOW in executables:
        make_site(tmp_path / "site.zarr")
    cases = [(name, *case) for name in sorted(executables) for case in REFUSED[name]]
    messages = refusals([start_of(name, parameters) for name, parameters, _ in cases])
    for (name, parameters, text), message in zip(cases, messages, strict=True):
        assert text in message, (name, parameters)


def test_executable_without_ros_names_the_remedy():
    text = "import runpy, sys; sys.modules['rclpy'] = None; sys.argv = ['-m']; runpy.run_module"
    module = "grid_map_ros_py._executables.grid_map_loader"
    command = [sys.executable, "-c", f"{text}({module!r}, run_name='__main__')"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert re.fullmatch(r".*'?rclpy.*\. Source ROS 2, then the workspace\n", done.stderr)
