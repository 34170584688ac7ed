# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The launch files as users start them: every demo, and what shows it, over DDS.

Where `ros2 launch` is installed it starts them. Elsewhere `launch_files` does.
"""

import os
import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml
from ament_index_python.packages import get_package_share_directory
from demos import lives
from geometry_msgs.msg import PolygonStamped
from launch_files import LAUNCH_FILES, read_launch_file
from nav_msgs.msg import GridCells, OccupancyGrid
from sensor_msgs.msg import Image, PointCloud2
from visualization_msgs.msg import Marker

from grid_map_demos_py.share import share
from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.testing import Process, environment, peer, reserve_domain

HAS_ROS_LAUNCH = bool(shutil.which("ros2") and find_spec("ros2launch"))

SHOWN = {
    "rviz_default_plugins/GridCells": GridCells,
    "rviz_default_plugins/Image": Image,
    "rviz_default_plugins/Map": OccupancyGrid,
    "rviz_default_plugins/Marker": Marker,
    "rviz_default_plugins/PointCloud2": PointCloud2,
    "rviz_default_plugins/Polygon": PolygonStamped,
}
"""Types of message by the display of RViz."""

RARE = {"/polygon"}
"""Topics of which nobody wants to wait for a message: the demo sends one every half a minute."""


def shown_in_rviz(demo: str) -> dict[str, type]:
    """Return the types of message by topic that RViz listens to."""
    content = yaml.safe_load(share("rviz", f"{demo}.rviz").read_text())
    displays = content["Visualization Manager"]["Displays"]
    types = {d["Topic"]["Value"]: SHOWN[d["Class"]] for d in displays if "Topic" in d}
    return {topic: types[topic] for topic in types.keys() - RARE}


def start(path: Path, domain: int) -> list[Process]:
    if HAS_ROS_LAUNCH:
        commands = [["ros2", "launch", "grid_map_demos_py", path.name, "rviz:=false"]]
    else:
        nodes = read_launch_file(path, get_package_share_directory, rviz="false")
        commands = [[sys.executable, "-m", node.module, *node.arguments] for node in nodes]
    return [Process(command, environment(domain)) for command in commands]


@contextmanager
def launched(path: Path, domain: int) -> Iterator[None]:
    """Start a launch file; it must live for 3 s, and end without complaints when interrupted."""
    processes = start(path, domain)
    try:
        yield
        for process in processes:
            lives(process)
        for process in processes:
            # As Ctrl-C in a terminal, which all that run in it get.
            os.killpg(process.pid, signal.SIGINT)
        for process in processes:
            assert process.wait() == 0, process.text
            assert "Traceback" not in process.text, process.text
            assert "process has died" not in process.text, process.text
    finally:
        for process in processes:
            process.kill()


@contextmanager
def brings_everything_that_rviz_shows(path: Path) -> Iterator[None]:
    """Start a launch file in a domain of its own; at the end every topic must bring a message."""
    topics = shown_in_rviz(path.name.removesuffix("_launch.xml"))
    assert topics
    domain, lock = reserve_domain()
    with lock, peer(domain) as other:
        for topic, message_type in topics.items():
            # Raw, as to turn markers into Python takes longer than to make them.
            received = other.received.setdefault(topic, [])
            other.node.create_subscription(
                message_type, topic, received.append, map_qos(), raw=True
            )
        with launched(path, domain):
            yield
            for topic in topics:
                other.expect(topic)


# Two at a time, as for most of the 3 s of its life a demo does nothing new.
@pytest.mark.parametrize(
    "paths",
    [LAUNCH_FILES[k : k + 2] for k in range(0, len(LAUNCH_FILES), 2)],
    ids=lambda paths: "+".join(path.name.removesuffix("_launch.xml") for path in paths),
)
def test_launch_files_bring_everything_that_rviz_shows(paths):
    with ExitStack() as stack:
        for path in paths:
            stack.enter_context(brings_everything_that_rviz_shows(path))
