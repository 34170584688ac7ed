# SPDX-License-Identifier: BSD-3-Clause
"""Helpers for the tests of all demos and their launch files.

ROS launch has no wheels, so the tests read the XML themselves. Elements, attributes and
substitutions that the demos do not use fail an assertion instead of being skipped.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml
from geometry_msgs.msg import PolygonStamped
from nav_msgs.msg import GridCells, OccupancyGrid, Path as PathMessage
from sensor_msgs.msg import Image, PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message
from grid_map_ros_py.testing import Process, peer, running_node

WORKSPACE = Path(__file__).parents[2]
PACKAGE = WORKSPACE / "grid_map_demos_py"
DATA = PACKAGE / "data"
LAUNCH_FILES = {
    path.name.removesuffix("_launch.xml"): path for path in sorted((PACKAGE / "launch").iterdir())
}
"""Launch files by demo name; each demo has an RViz configuration of the same name."""

ATTRIBUTES = {
    "launch": set(),
    "arg": {"name", "default", "description"},
    "node": {"pkg", "exec", "output", "name", "args", "if", "respawn", "respawn_delay"},
    "param": {"from", "name", "value"},
}

MESSAGES = {
    "rviz_default_plugins/GridCells": GridCells,
    "rviz_default_plugins/Image": Image,
    "rviz_default_plugins/Map": OccupancyGrid,
    "rviz_default_plugins/Marker": Marker,
    "rviz_default_plugins/MarkerArray": MarkerArray,
    "rviz_default_plugins/Path": PathMessage,
    "rviz_default_plugins/PointCloud2": PointCloud2,
    "rviz_default_plugins/Polygon": PolygonStamped,
}
"""Message types by RViz display; every RViz installation has these displays."""


def published(
    demo: str,
    *pairs: str,
    topic: str = "/grid_map",
    count: int = 1,
    until: Callable[[Process], bool] = lambda _: True,
) -> tuple[list[GridMap], str]:
    """Return the maps that a demo publishes, and its output.

    Args:
        demo: module of the node without `_node`.
        pairs: parameters, each as `name:=value`.
        topic: topic of grid maps.
        count: number of maps to wait for.
        until: condition to wait for.
    """
    with peer() as other:
        other.listen(topic, GridMapMessage)
        with running_node(f"grid_map_demos_py.{demo}_node", *parameters(*pairs)) as process:
            other.expect(topic, count)
            other.wait_until(lambda: until(process), "the condition")
        return [from_message(message) for message in other.received[topic]], process.text


def parameters(*pairs: str) -> list[str]:
    """Return node arguments that set parameters, each given as `name:=value`."""
    return ["--ros-args", *(word for pair in pairs for word in ("-p", pair))]


def launched_nodes(demo: str) -> list[ElementTree.Element]:
    """Return the nodes of a launch file, with default arguments filled in.

    Packages are looked up in this workspace. Only the attribute `if` stays as it is.
    """
    defaults: dict[str, str] = {}
    root = ElementTree.parse(LAUNCH_FILES[demo]).getroot()
    for element in root.iter():
        assert element.attrib.keys() <= ATTRIBUTES[element.tag]
        for name, text in element.attrib.items():
            if name != "if":
                text = re.sub(r"\$\(var (\w+)\)", lambda found: defaults[found[1]], text)
                text = re.sub(r"\$\(find-pkg-share (\w+)\)", rf"{WORKSPACE}/\1", text)
                assert "$" not in text
                element.set(name, text)
        if element.tag == "arg":
            defaults[element.attrib["name"]] = element.attrib["default"]
    return root.findall("node")


def rviz(demo: str) -> Any:
    return yaml.safe_load((PACKAGE / "rviz" / f"{demo}.rviz").read_text())


def rviz_displays(demo: str) -> dict[str, dict[str, Any]]:
    """Return the displays in the RViz configuration of a demo, by topic."""
    displays = rviz(demo)["Visualization Manager"]["Displays"]
    return {display["Topic"]["Value"]: display for display in displays if "Topic" in display}
