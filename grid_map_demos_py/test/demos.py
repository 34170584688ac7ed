# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Helpers for the tests of all demos."""

import os
import time
from pathlib import Path

from grid_map_ros_py.testing import Process, wait_until


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
