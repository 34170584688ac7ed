# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The nodes that the launch files of the demos name.

ROS launch has no wheels, so the tests read the XML themselves. Elements, attributes and
substitutions that the demos do not use fail an assertion instead of being skipped.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import yaml
from geometry_msgs.msg import PolygonStamped
from nav_msgs.msg import GridCells, OccupancyGrid
from sensor_msgs.msg import Image, PointCloud2
from visualization_msgs.msg import Marker

WORKSPACE = Path(__file__).parents[2]
LAUNCH_FILES = sorted((WORKSPACE / "grid_map_demos_py" / "launch").iterdir())

REQUIRED = {
    "arg": {"name", "default", "description"},
    "node": {"pkg", "exec", "output"},
    "param": set(),
}
OPTIONAL = {"node": {"name", "args", "if"}, "param": {"from", "name", "value"}}


MESSAGES = {
    "rviz_default_plugins/GridCells": GridCells,
    "rviz_default_plugins/Image": Image,
    "rviz_default_plugins/Map": OccupancyGrid,
    "rviz_default_plugins/Marker": Marker,
    "rviz_default_plugins/PointCloud2": PointCloud2,
    "rviz_default_plugins/Polygon": PolygonStamped,
}
"""Type of message by display of RViz; every installation of RViz has these displays."""


def rviz_displays(demo: str) -> dict[str, dict[str, Any]]:
    """Return the displays by topic in the configuration of RViz for a demo."""
    path = WORKSPACE / "grid_map_demos_py" / "rviz" / f"{demo}.rviz"
    displays = yaml.safe_load(path.read_text())["Visualization Manager"]["Displays"]
    return {display["Topic"]["Value"]: display for display in displays if "Topic" in display}


@dataclass(frozen=True)
class LaunchedNode:
    """A `<node>` of a launch file, with the default arguments filled in."""

    package: str
    executable: str
    name: str | None
    arguments: list[str]
    parameter_files: list[Path]
    parameters: dict[str, str]
    condition: str | None

    @property
    def module(self) -> str:
        """The Python module behind the executable."""
        return entry_points(self.package)[self.executable]


def entry_points(package: str) -> dict[str, str]:
    """Return the modules of the executables of a package of this workspace, by name."""
    setup = (WORKSPACE / package / "setup.py").read_text()
    return dict(re.findall(r'"(\w+) = ([\w.]+):\w+"', setup))


def read_launch_file(path: Path) -> list[LaunchedNode]:
    """Return the nodes of a launch file; packages are looked up in this workspace."""
    root = ElementTree.parse(path).getroot()
    assert root.tag == "launch"
    for element in root.iter():
        if element is not root:
            required = REQUIRED[element.tag]
            found = {*element.attrib}
            assert required <= found <= required | OPTIONAL.get(element.tag, set())
            assert element.get("output", "screen") == "screen"
    defaults: dict[str, str] = {}

    def filled(text: str) -> str:
        for name, value in defaults.items():
            text = text.replace(f"$(var {name})", value)
        text = re.sub(r"\$\(find-pkg-share (\w+)\)", lambda m: str(WORKSPACE / m[1]), text)
        assert "$" not in text
        return text

    for arg in root.iter("arg"):
        defaults[arg.attrib["name"]] = filled(arg.attrib["default"])
    return [
        LaunchedNode(
            package=node.attrib["pkg"],
            executable=node.attrib["exec"],
            name=node.get("name"),
            arguments=filled(node.get("args", "")).split(),
            parameter_files=[Path(filled(p.attrib["from"])) for p in node if "from" in p.attrib],
            parameters={
                p.attrib["name"]: filled(p.attrib["value"]) for p in node if "name" in p.attrib
            },
            condition=node.get("if"),
        )
        for node in root.iter("node")
    ]
