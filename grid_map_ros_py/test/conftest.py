# SPDX-License-Identifier: BSD-3-Clause
"""Fixtures and settings of the tests of this package."""

import sys
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType
from typing import Any

import nav2_stand_in
import pytest

from grid_map_ros_py.testing import Peer, Process, peer

Start = Callable[..., Process]

NODES = Path(__file__).parent / "nodes"


@pytest.fixture
def start() -> Iterator[Start]:
    """Function that starts a script of `nodes/`; the script is killed after the test."""
    with ExitStack() as stack:

        def start_script(script: str, *arguments: str) -> Process:
            process = Process([sys.executable, str(NODES / script), *arguments])
            stack.callback(process.kill)
            return process

        yield start_script


@pytest.fixture
def no_mcap(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hide the packages that read and write MCAP files."""
    for module in ("mcap", "mcap.reader", "mcap.writer", "rosbag2_py"):
        monkeypatch.setitem(sys.modules, module, None)  # type: ignore[arg-type]


@pytest.fixture
def rosbag2_py(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the package `mcap` by a stand-in for `rosbag2_py`."""
    request.getfixturevalue("no_mcap")
    stand_in = pytest.importorskip("rosbag2_py_of_rosbags")
    monkeypatch.setitem(sys.modules, "rosbag2_py", stand_in)
    monkeypatch.setitem(sys.modules, "rosbag2_py._storage", stand_in._storage)


@pytest.fixture
def nav2(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace messages for nav2 by stand-ins; test_optional_messages.py uses the real ones."""
    for package in ("map_msgs", "nav2_msgs"):
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", nav2_stand_in)


@pytest.fixture
def other_side() -> Iterator[Peer]:
    """Peer in the domain of the processes that the test starts."""
    with peer() as other:
        yield other


def call(other: Peer, kind: type, service: str, **request: object) -> Any:
    """Call a service of another process, and return its answer."""
    clients = {client.srv_name: client for client in other.node.clients}
    client = clients.get(service) or other.node.create_client(kind, service)
    other.wait_until(client.service_is_ready, service)
    answer = client.call_async(kind.Request(**request))
    other.wait_until(answer.done, f"an answer of {service}")
    return answer.result()


def peak_memory(operation: Callable[[], object]) -> int:
    """Return the peak memory of an operation [bytes]."""
    operation()
    tracemalloc.start()
    try:
        operation()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def arguments(**parameters: object) -> list[str]:
    """Return command line arguments that set parameters of a node."""
    options = [("-p", f"{name}:={value}") for name, value in parameters.items()]
    return ["--ros-args", *(word for option in options for word in option)]
