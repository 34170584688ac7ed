# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The octomap demo: its files and its map.

Services need `octomap_msgs`; they are tested with the other optional messages of the workspace.
"""

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from demos import published

from grid_map_core_py import load
from grid_map_ros_py.testing import Process

DEMO = "grid_map_demos_py.octomap_to_gridmap_demo_node"
ROOM = Path(__file__).parents[1] / "data" / "room.bt"


def test_the_room_is_shown_below_its_ceiling():
    given = (f"octomap_path:={ROOM}", "max_z:=2", "min_x:=-1.0")
    (grid_map,), _ = published("octomap_to_gridmap_demo", *given)
    assert (grid_map.frame_id, grid_map.layers) == ("map", ("elevation",))
    assert grid_map.basic_layers == ("elevation",)
    assert grid_map.timestamp > 0
    np.testing.assert_allclose(grid_map.length, (3.0, 3.0))
    np.testing.assert_allclose(grid_map.position, (0.5, 0.0), atol=1e-9)
    # Centers of the highest voxels, of 5 cm.
    places = {"floor": (0.0, 0.0), "table": (0.8, 0.6), "box": (1.0, -0.8), "wall": (0.0, 1.475)}
    heights = {name: grid_map.at_position("elevation", xy) for name, xy in places.items()}
    expected = {"floor": -0.025, "table": 0.675, "box": 0.375, "wall": 1.975}
    assert heights == pytest.approx(expected, abs=1e-6)


def test_map_from_above_shows_only_the_ceiling():
    heights = load(ROOM)["elevation"]
    assert heights.shape == (80, 60)
    np.testing.assert_allclose(heights, 2.425, atol=1e-6)


def test_missing_service_messages_are_named_with_their_package(tmp_path):
    (tmp_path / "octomap_msgs.py").write_text("raise ImportError")
    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    demo = Process([sys.executable, "-m", DEMO], {"PYTHONPATH": path})
    assert demo.wait() == 1
    (line,) = demo.lines
    assert "octomap_to_gridmap_demo needs the package 'octomap_msgs', which is not" in line
    assert "name a file by 'octomap_path'" in line
