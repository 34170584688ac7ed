# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Process groups end with the process that started them."""

import subprocess
import sys

START = """
import os
from grid_map_demos_py.processes import ProcessGroup

{}
with ProcessGroup() as processes:
    processes.start("this", [])
    print(processes.wait())
"""


def started(preparation: str) -> str:
    """Return the output of a group that is started after some preparation, and of its process."""
    done = subprocess.run(
        [sys.executable, "-c", START.format(preparation)],
        capture_output=True,
        text=True,
        timeout=30,
        check=True,
    )
    return done.stdout


def test_process_group_works_in_process_1():
    # Like process 1 of a container that runs nothing else.
    output = started("os.getpid = os.getppid = lambda: 1")
    assert "The Zen of Python" in output
    assert output.endswith("('this', 0)\n")


def test_process_without_parent_ends_immediately():
    # The new parent is process 1 or a subreaper.
    output = started("os.getppid = lambda: 4711")
    assert output == "('this', 0)\n"
