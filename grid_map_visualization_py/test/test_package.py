# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The package as a whole."""

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


def run_without_ros(code: str, *arguments: str) -> None:
    """Run code in an interpreter that finds neither rclpy nor message packages."""
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_ROS + code, *arguments], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("module", ["", ".colors", ".pictures", ".surface"])
def test_module_imports_without_ros(module):
    run_without_ros(f"import grid_map_visualization_py{module}")


@pytest.mark.parametrize("style", ["flat", "surface", "relief"])
def test_picture_is_drawn_without_ros(tmp_path, style):
    code = """
from grid_map_core_py import GridMap
from grid_map_visualization_py.pictures import save_picture

grid_map = GridMap((1.0, 1.0), 0.1, layers={"elevation": 0.5})
save_picture(grid_map, "elevation", sys.argv[1], style=sys.argv[2])
"""
    run_without_ros(code, str(tmp_path / "map.png"), style)
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


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
