# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The nodes of every launch file publish over DDS all that RViz shows."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from demos import lives
from launch_files import LAUNCH_FILES, MESSAGES, LaunchedNode, read_launch_file, rviz_displays

from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.testing import Process, environment, peer, reserve_domain

RARE = {"/polygon"}
"""Topics with one message every half a minute, too rare to wait for."""


def command(node: LaunchedNode) -> list[str]:
    """Return the command line by which ROS launch would start a node."""
    options = [("--params-file", str(path)) for path in node.parameter_files]
    options += [("-p", f"{name}:={value}") for name, value in node.parameters.items()]
    options += [("-r", f"__node:={node.name}")] if node.name else []
    words = [word for option in options for word in option]
    return [sys.executable, "-m", node.module, *node.arguments, "--ros-args", *words]


@contextmanager
def launched(path: Path, domain: int) -> Iterator[None]:
    """Start the nodes; they must live for 3 s, and end without complaints when interrupted."""
    nodes = [node for node in read_launch_file(path) if node.package != "rviz2"]
    processes = [Process(command(node), environment(domain)) for node in nodes]
    try:
        yield
        for process in processes:
            lives(process)
        for process in processes:
            # Like Ctrl-C in a terminal, which reaches all its processes.
            os.killpg(process.pid, signal.SIGINT)
        for process in processes:
            assert process.wait() == 0, process.text
            assert "Traceback" not in process.text, process.text
    finally:
        for process in processes:
            process.kill()


@contextmanager
def publishes_everything_that_rviz_shows(path: Path) -> Iterator[None]:
    """Start a launch file in its own domain; at the end every topic must have brought a message."""
    displays = rviz_displays(path.name.removesuffix("_launch.xml"))
    topics = {topic: MESSAGES[displays[topic]["Class"]] for topic in displays.keys() - RARE}
    assert topics
    domain, lock = reserve_domain()
    with lock, peer(domain) as other:
        for topic, message_type in topics.items():
            # Raw, because deserialization takes longer than making a marker.
            received = other.received.setdefault(topic, [])
            other.node.create_subscription(
                message_type, topic, received.append, map_qos(), raw=True
            )
        with launched(path, domain):
            yield
            for topic in topics:
                other.expect(topic)


# Two at a time, because a demo is idle for most of its 3 s.
@pytest.mark.parametrize(
    "paths",
    [LAUNCH_FILES[k : k + 2] for k in range(0, len(LAUNCH_FILES), 2)],
    ids=lambda paths: "+".join(path.name.removesuffix("_launch.xml") for path in paths),
)
def test_launch_files_publish_everything_that_rviz_shows(paths):
    with ExitStack() as stack:
        for path in paths:
            stack.enter_context(publishes_everything_that_rviz_shows(path))
