# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Helpers for the tests of all demos."""

import os
import time
from collections.abc import Callable
from pathlib import Path

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message
from grid_map_ros_py.testing import Process, peer, running_node, wait_until


def published(
    demo: str,
    *pairs: str,
    topic: str = "/grid_map",
    count: int = 1,
    until: Callable[[Process], bool] = lambda _: True,
) -> tuple[list[GridMap], str]:
    """Return the maps that a demo publishes, and its output; it must live for some seconds.

    Args:
        demo: module of the node without `_node`.
        pairs: parameters, each as `name:=value`.
        topic: topic of the maps.
        count: number of maps to wait for.
        until: condition to wait for.
    """
    with peer() as other:
        other.listen(topic, GridMapMessage)
        with running_node(f"grid_map_demos_py.{demo}_node", *parameters(*pairs)) as process:
            other.expect(topic, count)
            other.wait_until(lambda: until(process), "the condition")
            lives(process)
        return [from_message(message) for message in other.received[topic]], process.text


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


def parameters(*pairs: str) -> list[str]:
    """Return the arguments of a node that is given parameters, each as `name:=value`."""
    return ["--ros-args", *(word for pair in pairs for word in ("-p", pair))]
