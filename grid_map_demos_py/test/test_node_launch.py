# SPDX-License-Identifier: BSD-3-Clause
"""The nodes of every launch file publish all topics that RViz shows, over DDS."""

import math
import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
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


def lives(process: Process, seconds: float = 3.0) -> None:
    """Wait until a process has run for a time [s]; fail if it ends earlier.

    The time counts from the start of the process.
    """

    def is_old_enough() -> bool:
        assert process.is_running, process.text
        return age(process) >= seconds

    wait_until(is_old_enough, f"{seconds:g} s of life")


def age(process: Process) -> float:
    """Return the seconds since the start of a running process (proc_pid_stat(5), field 22)."""
    fields_after_name = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    started = int(fields_after_name[22 - 3]) / os.sysconf("SC_CLK_TCK")
    return time.clock_gettime(time.CLOCK_BOOTTIME) - started


@contextmanager
def launched(demo: str, domain: int) -> Iterator[None]:
    """Start the nodes; they must run for 3 s, and exit without errors when interrupted."""
    nodes = [node for node in launched_nodes(demo) if node.get("pkg") != "rviz2"]
    processes = [Process(command(node), environment(domain)) for node in nodes]
    try:
        yield
        for process in processes:
            lives(process)
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
