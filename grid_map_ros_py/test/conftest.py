# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What tests of running nodes share: a domain of their own and processes that are cleaned up."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import domain_coordinator
import pytest
from hypothesis import settings

# How long an example takes says more about the machine than about the code.
settings.register_profile("grid_map", deadline=None)
settings.load_profile("grid_map")

Start = Callable[..., subprocess.Popen[str]]

NODES = Path(__file__).parent / "nodes"


@pytest.fixture
def ros_environment() -> Iterator[dict[str, str]]:
    """The environment of processes that see each other and nobody else."""
    with domain_coordinator.domain_id() as domain:
        yield {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONUNBUFFERED": "1",
        }


@pytest.fixture
def start(ros_environment: dict[str, str]) -> Iterator[Start]:
    """Start a script of `nodes/` with arguments; it is stopped at the end of the test."""
    processes = []

    def start_node(script: str, *arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, str(NODES / script), *arguments],
            env=ros_environment,
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
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
        process.communicate()
