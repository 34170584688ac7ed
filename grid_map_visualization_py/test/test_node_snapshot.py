# SPDX-License-Identifier: BSD-3-Clause
"""The executable `snapshot`, run as a process."""

import matplotlib.image
import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_ros_py import testing, to_message
from grid_map_ros_py.testing import Process, start_node
from grid_map_visualization_py._executables.snapshot import main, parsed

MODULE = "grid_map_visualization_py._executables.snapshot"


@pytest.fixture
def grid_map() -> GridMap:
    slope = np.arange(12.0).reshape(4, 3)
    return GridMap((4, 3), 1.0, layers={"elevation": slope, "slope": 0.5}, frame_id="odom")


def ended(grid_map: GridMap, topic: str, *arguments: str) -> Process:
    """Return the process after it has got a map."""
    process = start_node(MODULE, *arguments)
    try:
        with testing.peer() as peer:
            peer.publish(topic, to_message(grid_map))
            peer.wait_until(lambda: not process.is_running, "the end")
    finally:
        process.kill()
    return process


def test_picture_of_a_topic(grid_map, tmp_path):
    path = tmp_path / "map.png"
    options = "--topic", "/terrain", "--out", str(path), "--color-map", "turbo"
    process = ended(grid_map, "/terrain", *options)
    assert (process.wait(), process.text) == (0, f"{path}\n")
    assert matplotlib.image.imread(path).shape[0] > 300


def test_a_missing_layer_is_one_error(grid_map, tmp_path):
    path = tmp_path / "map.png"
    process = ended(grid_map, "/grid_map", "--layer", "height", "--out", str(path))
    assert process.wait() == 1
    assert "/grid_map: no layer 'height'; available: elevation, slope" in process.text
    assert not path.exists()


def test_topic_without_maps_is_an_error(tmp_path):
    path = tmp_path / "map.png"
    process = start_node(MODULE, "--timeout", "0.2", "--out", str(path))
    assert process.wait() == 1
    assert "no map on /grid_map within 0.2 s" in process.text
    assert len(process.lines) == 1, process.text
    assert not path.exists()


@pytest.mark.parametrize("timeout", ["0", "-1", "nan", "inf"])
def test_invalid_time_is_reported_in_one_message(monkeypatch, capfd, timeout):
    monkeypatch.setattr("sys.argv", ["snapshot", "--timeout", timeout])
    assert main() == 1
    assert "parameter '--timeout': expected a positive time" in capfd.readouterr().err


def test_conflicting_options_are_refused(capsys):
    with pytest.raises(SystemExit, match="2"):
        parsed(["--color-layer", "a"])
    assert "--color-layer goes with --3d or --relief only" in capsys.readouterr().err
