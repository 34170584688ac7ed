# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
import re
import subprocess
import sys
from pathlib import Path

import pytest

import grid_map_ros_py

README = Path(__file__).parents[1] / "README.md"

CONVERSIONS_ALONE = """
import sys
import numpy as np
from grid_map_core_py import GridMap, Polygon
import grid_map_ros_py as ros

grid_map = GridMap((1, 1), 0.5, layers={"elevation": 1.0})
ros.from_message(ros.to_message(grid_map))
ros.from_point_cloud(ros.to_point_cloud(grid_map, "elevation"), resolution=0.5)
ros.to_occupancy_grid(grid_map, "elevation", 0, 1)
ros.from_grid_cells(ros.to_grid_cells(grid_map, "elevation", 0, 1), "covered")
ros.from_image(ros.to_image(grid_map, "elevation", "mono8"), "elevation", 0.5)
ros.from_polygon(ros.to_polygon(Polygon([(0, 0), (1, 0), (1, 1)])))
unwanted = {"rclpy", "nav2_msgs", "octomap_msgs", "cv_bridge", "tf2_ros", "rosbag2_py"}
print(sorted(unwanted & {name.split(".")[0] for name in sys.modules}))
"""


def test_the_conversions_work_without_rclpy() -> None:
    result = subprocess.run(
        [sys.executable, "-c", CONVERSIONS_ALONE], capture_output=True, text=True, check=False
    )
    assert (result.stdout, result.stderr) == ("[]\n", "")


@pytest.mark.parametrize("example", re.findall(r"```python\n(.*?)```", README.read_text(), re.S))
def test_the_examples_of_the_readme_work(example: str) -> None:
    names: dict[str, object] = {"__name__": "readme"}
    exec(compile(example, README, "exec"), names)  # noqa: S102
    assert "GridMap" in names


def test_every_public_name_exists_and_is_documented() -> None:
    for name in grid_map_ros_py.__all__:
        assert getattr(grid_map_ros_py, name).__doc__, name
