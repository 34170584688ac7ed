# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Dependencies and imports of the package."""

import importlib.util
import subprocess
import sys

import pytest

WITHOUT_ROS = """
import sys
from importlib.abc import MetaPathFinder

class NoRos(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top.endswith(("_msgs", "_interfaces")) or top in ("rclpy", "grid_map_ros_py"):
            raise ImportError(f"{name} needs ROS")

sys.meta_path.insert(0, NoRos())
"""


DRAW = """
from grid_map_core_py import GridMap
from grid_map_visualization_py import colors, surface
from grid_map_visualization_py.pictures import save_picture

grid_map = GridMap((1.0, 1.0), 0.1, layers={"elevation": 0.5})
for style in ("flat", "surface", "relief"):
    save_picture(grid_map, "elevation", style + ".png", style=style)
"""


def test_pictures_are_drawn_without_rclpy_and_message_packages(tmp_path):
    command = [sys.executable, "-c", WITHOUT_ROS + DRAW]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for style in ("flat", "surface", "relief"):
        assert (tmp_path / f"{style}.png").read_bytes().startswith(b"\x89PNG")


def test_visualizations_load_on_first_use():
    assert importlib.util.find_spec("visualization_msgs")
    code = """
import grid_map_visualization_py as visualization
assert not [name for name in sys.modules if name.endswith("_msgs")]
assert "surface" in visualization.VISUALIZATIONS.types
assert "visualization_msgs" in sys.modules
"""
    subprocess.run([sys.executable, "-c", "import sys" + code], check=True)


def test_unknown_name_of_the_package_is_an_attribute_error():
    package = importlib.import_module("grid_map_visualization_py")
    with pytest.raises(AttributeError, match="no attribute 'creat'"):
        _ = package.creat
