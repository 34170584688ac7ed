# SPDX-License-Identifier: BSD-3-Clause
import re
import subprocess
import sys
import textwrap

import grid_map_ros_py
from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import nodes
from grid_map_ros_py.testing import Process, peer, running

CONVERSIONS_ALONE = """
import sys
from grid_map_core_py import GridMap, Polygon
import grid_map_ros_py as ros

grid_map = GridMap((1, 1), 0.5, layers={"elevation": 1.0})
ros.from_message(ros.to_message(grid_map))
ros.from_point_cloud(ros.to_point_cloud(grid_map, "elevation"), resolution=0.5)
ros.to_occupancy_grid(grid_map, "elevation", 0, 1)
ros.from_grid_cells(ros.to_grid_cells(grid_map, "elevation", 0, 1), "covered")
ros.from_image(ros.to_image(grid_map, "elevation", "mono8"), "elevation", 0.5)
ros.from_polygon(ros.to_polygon(Polygon([(0, 0), (1, 0), (1, 1)])))
unwanted = {"rclpy", "scipy", "nav2_msgs", "octomap_msgs", "cv_bridge", "tf2_ros", "rosbag2_py"}
print(sorted(unwanted & {name.split(".")[0] for name in sys.modules}))
"""


WITHOUT_MESSAGES = """
import importlib.abc, sys

class NoMessages(importlib.abc.MetaPathFinder):
    def find_spec(self, name, *_):
        package = name.partition(".")[0]
        if package.endswith(("_msgs", "_interfaces")) or package.startswith(("rcl", "rosidl")):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, NoMessages())
from grid_map_core_py import GridMap
from grid_map_core_py.errors import MissingPackageError
import grid_map_ros_py as ros
from grid_map_ros_py import bags, errors, messages

grid_map = GridMap((1, 1), 0.25, layers={"elevation": 1.0}, frame_id="map", timestamp=3)
grid_map.move((0.5, 0.25))
received = ros.ReceivedMap(ros.to_serialized_message(grid_map))
print(received.start_index == grid_map.start_index, received.frame_id)
ros.from_message(messages.view(received.data, "grid_map_msgs/GridMap"))
try:
    ros.to_message(grid_map)
except MissingPackageError as error:
    print(error)
"""


def test_import_needs_no_message_package():
    result = subprocess.run(
        [sys.executable, "-c", WITHOUT_MESSAGES], capture_output=True, text=True, check=False
    )
    assert result.stderr == ""
    found, refusal = result.stdout.splitlines()
    assert found == "True map"
    assert re.search(r"apt install ros-\w+-\w+-msgs, then source ROS 2", refusal)


def test_conversions_work_without_rclpy() -> None:
    result = subprocess.run(
        [sys.executable, "-c", CONVERSIONS_ALONE], capture_output=True, text=True, check=False
    )
    assert (result.stdout, result.stderr) == ("[]\n", "")


def test_node_in_the_documentation_runs(tmp_path) -> None:
    (code,) = re.findall(r"(?ms)^    from rclpy.*?run\(Scaler\)\)$", nodes.__doc__)
    example = textwrap.dedent(code)
    (tmp_path / "scaler.py").write_text(example)
    process = Process(
        [sys.executable, str(tmp_path / "scaler.py"), "--ros-args", "-p", "factor:=2"]
    )
    with running(process), peer() as other:
        other.listen("/scaled_map", GridMapMessage)
        layers = {"elevation": 1.5}
        other.publish("/grid_map", grid_map_ros_py.to_message(GridMap((1, 1), 0.5, layers=layers)))
        assert set(other.expect("/scaled_map").data[0].data) == {3.0}
