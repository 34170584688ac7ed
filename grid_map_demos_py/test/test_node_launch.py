# SPDX-License-Identifier: BSD-3-Clause
"""The nodes of every launch file publish all topics that RViz shows, over DDS."""

import math
import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from xml.etree.ElementTree import Element

import pytest
from ament_index_python.packages import get_package_prefix
from demos import LAUNCH_FILES, MESSAGES, launched_nodes, rviz_displays

from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.testing import Process, environment, peer, reserve_domain, wait_until

RARE = {"/polygon"}
"""Topics with one message every 30 s, too rare to wait for."""

DEMOS = [*LAUNCH_FILES]
HALF = math.ceil(len(DEMOS) / 2)


def command(node: Element) -> list[str]:
    """Return the command line with which ROS launch starts a node."""
    package, executable = node.get("pkg"), node.get("exec")
    options = [("-r", f"__node:={node.get('name')}")] if node.get("name") else []
    for parameter in node.iter("param"):
        file, name, value = map(parameter.get, ("from", "name", "value"))
        options.append(("--params-file", file) if file else ("-p", f"{name}:={value}"))
    words = [word for option in options for word in option]
    path = f"{get_package_prefix(package)}/lib/{package}/{executable}"
    return [path, *node.get("args", "").split(), "--ros-args", *words]


@contextmanager
def launched(demo: str, domain: int) -> Iterator[None]:
    """Start the nodes; they must run for 3 s, and exit without errors when interrupted."""
    end = time.monotonic() + 3.0
    nodes = [node for node in launched_nodes(demo) if node.get("pkg") != "rviz2"]
    processes = [Process(command(node), environment(domain)) for node in nodes]
    try:
        yield
        wait_until(lambda: time.monotonic() > end, "3 s of life")
        assert all(process.is_running for process in processes)
        # One after the other, because nodes that end at once can hang in Fast DDS 2.14.
        for process in processes:
            os.killpg(process.pid, signal.SIGINT)
            assert process.wait() == 0, process.text
            assert "Traceback" not in process.text, process.text
    finally:
        for process in processes:
            process.stop()
            print(process.text)  # shown if the test fails


@contextmanager
def publishes_everything_that_rviz_shows(demo: str) -> Iterator[None]:
    """Start a launch file in its own domain; by the end, each topic must have a message."""
    displays = rviz_displays(demo)
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
        with launched(demo, domain):
            yield
            for topic in topics:
                other.expect(topic)


# Two at a time, because a demo is idle for most of its 3 s; never two neighbors.
@pytest.mark.parametrize("demos", (DEMOS[i::HALF] for i in range(HALF)), ids="+".join)
def test_launch_files_publish_everything_that_rviz_shows(demos):
    with ExitStack() as stack:
        for demo in demos:
            stack.enter_context(publishes_everything_that_rviz_shows(demo))
