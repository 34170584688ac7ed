# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Settings of all tests of this package, and nodes that are cleaned up."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from grid_map_ros_py.testing import environment

# How long an example takes says more about the machine than about the code.
settings.register_profile("grid_map", deadline=None)
settings.load_profile("grid_map")

Start = Callable[..., subprocess.Popen[str]]

NODES = Path(__file__).parent / "nodes"


@pytest.fixture
def start() -> Iterator[Start]:
    """Start a script of `nodes/` with arguments; it is stopped at the end of the test."""
    processes = []

    def start_node(script: str, *arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, str(NODES / script), *arguments],
            env=environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            # Interrupts meant for the tests are not meant for the node.
            start_new_session=True,
        )
        processes.append(process)
        return process

    yield start_node
    for process in processes:
        process.kill()
        process.communicate()
