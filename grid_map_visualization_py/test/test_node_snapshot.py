# SPDX-License-Identifier: BSD-3-Clause
"""The executable `snapshot`, run as a process."""

import matplotlib.image
import numpy as np
import pytest

from grid_map_core_py import GridMap
from grid_map_ros_py import to_message
from grid_map_ros_py.testing import start_node
from grid_map_visualization_py._executables.snapshot import main, parsed

MODULE = "grid_map_visualization_py._executables.snapshot"


@pytest.mark.parametrize(
    ("layer", "code", "text"),
    [
        ("slope", 0, "map.png\n"),
        ("height", 1, "/terrain: no layer 'height'; available: elevation, slope\n"),
    ],
)
def test_next_map_of_a_topic_is_drawn_or_refused(peer, tmp_path, layer, code, text):
    path = tmp_path / "map.png"
    slope = np.arange(12.0).reshape(4, 3)
    grid_map = GridMap((4, 3), 1.0, layers={"elevation": slope, "slope": 0.5}, frame_id="odom")
    process = start_node(MODULE, "--topic", "/terrain", "--out", str(path), "--layer", layer)
    try:
        peer.publish("/terrain", to_message(grid_map))
        assert process.wait() == code
    finally:
        process.stop()
    assert process.text.endswith(text)
    assert len(process.lines) == 1
    assert path.exists() == (code == 0)
    if path.exists():
        assert matplotlib.image.imread(path).shape[0] > 300


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
