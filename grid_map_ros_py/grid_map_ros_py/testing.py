# SPDX-License-Identifier: BSD-3-Clause
"""Test helpers that start nodes as processes and exchange messages with them.

All nodes that a test process starts share a ROS domain, which no other test process uses.
"""

import atexit
import json
import os
import signal
import socket
import subprocess
import sys
import time
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import cache
from tempfile import TemporaryFile
from typing import Any
from unittest.mock import patch

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.utilities import try_shutdown

from .nodes._topics import map_qos

__all__ = [
    "Peer",
    "Process",
    "peer",
    "running_node",
    "start_node",
    "wait_until",
]

DOMAINS = 100
"""Largest ROS domain ID to use; the ports of larger IDs have other uses on some systems."""

LOCK_PORTS = 32768
"""Base port; a socket bound to TCP port `LOCK_PORTS + domain` reserves a ROS domain."""

OTHER_WAS_FASTER = "open_and_lock_file failed"
"""Harmless Fast DDS error: another process took the port first, so Fast DDS uses the next one."""

TIMEOUT = 100.0
"""Default time to wait before a test fails [s]."""

REFUSALS = """
import json, sys
from pkgutil import resolve_name
from grid_map_ros_py.nodes import _health
_health.PATIENCE = 0.0  # Do not wait for subscribers.
starts, missing = json.loads(sys.argv[1])
sys.modules.update(dict.fromkeys(missing))
for main, words in starts:
    sys.argv[1:] = words
    print("exit code", resolve_name(main)(), flush=True)
"""
"""Program that calls the `main` functions of several nodes in turn; see `refusals`."""


def reserve_domain() -> tuple[int, socket.socket]:
    """Reserve a ROS domain other than `ROS_DOMAIN_ID`; return the domain and its lock socket."""
    for k in range(DOMAINS):
        # The first candidate depends on the process ID, so that no domain is reused immediately.
        domain = 1 + (os.getpid() + k) % DOMAINS
        if str(domain) == os.environ.get("ROS_DOMAIN_ID"):
            continue
        lock = socket.socket()
        try:
            lock.bind(("", LOCK_PORTS + domain))
        except OSError:
            lock.close()
        else:
            atexit.register(lock.close)
            return domain, lock
    raise RuntimeError(f"all {DOMAINS} ROS domains are taken by other tests")


reserved_domain = cache(reserve_domain)
"""Return the ROS domain of the tests in this process, and its lock socket."""


def environment(domain: int | None = None) -> dict[str, str]:
    """Return environment variables that let processes discover only each other.

    `domain` is the ROS domain ID; None means `reserved_domain`. Other ROS settings are removed.
    """
    settings = {name for name in os.environ if name.startswith(("ROS_", "RCUTILS_"))}
    settings -= {"ROS_DISTRO", "ROS_HOME", "ROS_LOG_DIR", "ROS_PYTHON_VERSION", "ROS_VERSION"}
    return {
        **{name: value for name, value in os.environ.items() if name not in settings},
        "ROS_DOMAIN_ID": str(domain or reserved_domain()[0]),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PYTHONUNBUFFERED": "1",
    }


def wait_until(
    condition: Callable[[], object],
    what: str,
    *,
    step: Callable[[], object] = lambda: time.sleep(0.02),
    timeout: float = TIMEOUT,
) -> None:
    """Call `step` until `condition()` is true; fail after `timeout` [s] and report `what`."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, f"waited in vain for {what}"
        step()


class Process(subprocess.Popen[bytes]):
    """Process in its own process group; `lines` contains its output without delay.

    Args:
        command: the program and its arguments.
        overrides: environment variables that override `environment`.
    """

    def __init__(self, command: Sequence[str], overrides: Mapping[str, str] | None = None) -> None:
        self._output = TemporaryFile(buffering=0)  # noqa: SIM115 (closed by the next line)
        weakref.finalize(self, self._output.close)
        super().__init__(
            list(command),
            stdout=self._output,
            stderr=subprocess.STDOUT,
            # Ctrl-C in the terminal must interrupt only the tests.
            start_new_session=True,
            env={**environment(), **(overrides or {})},
        )

    @property
    def lines(self) -> list[str]:
        """Complete lines of stdout and stderr so far, without a harmless message of Fast DDS."""
        file = self._output.fileno()
        text = os.pread(file, os.fstat(file).st_size, 0).decode(errors="replace")
        if self.returncode is None:
            text = text[: text.rfind("\n") + 1]
        return [line for line in text.splitlines(keepends=True) if OTHER_WAS_FASTER not in line]

    @property
    def text(self) -> str:
        """Text of `lines`."""
        return "".join(self.lines)

    @property
    def is_running(self) -> bool:
        """True while the process runs."""
        return self.poll() is None

    def wait(self, timeout: float | None = TIMEOUT) -> int:
        """Wait until the process ends and return its exit code."""
        return super().wait(timeout)

    def stop(self) -> None:
        """End the process group with SIGTERM, or with SIGKILL if it still runs after 10 s."""
        # A process killed during startup can make all new ROS processes hang (Fast DDS 2.14).
        for number in (signal.SIGTERM, signal.SIGKILL):
            if self.is_running:
                os.killpg(self.pid, number)
                with suppress(subprocess.TimeoutExpired):
                    self.wait(10.0)
        self.wait()


def start_node(module: str, *arguments: str) -> Process:
    """Start `python -m module arguments` and return the process."""
    return Process([sys.executable, "-m", module, *arguments])


def running_node(module: str, *arguments: str) -> AbstractContextManager[Process]:
    """Run `python -m module arguments` as a context manager.

    The node must run until the end of the context. After SIGINT, it must exit with code 0 and
    without a traceback.
    """
    return running(start_node(module, *arguments))


@contextmanager
def running(process: Process) -> Iterator[Process]:
    """Return a context manager that stops a started node; see `running_node`."""
    try:
        yield process
        assert process.is_running, process.text
        process.send_signal(signal.SIGINT)
        assert process.wait() == 0, process.text
        assert "Traceback" not in process.text, process.text
    finally:
        process.stop()


def refusals(
    starts: Sequence[tuple[str, Sequence[str]]], *, missing: Sequence[str] = ()
) -> list[str]:
    """Start nodes that must fail with exit code 1; return their error messages, one line each.

    `starts` contains `main` functions, such as "package.module:Class.main", and their arguments.
    Imports of the modules in `missing` fail.
    """
    given = json.dumps([starts, missing])
    process = Process([sys.executable, "-c", REFUSALS, given])
    try:
        assert process.wait(2 * TIMEOUT) == 0, process.text
    finally:
        process.stop()
    # The first process after a build also prints that loops are being compiled.
    lines = [line for line in process.lines if "numba compiles loops" not in line]
    assert lines[1::2] == ["exit code 1\n"] * len(starts), process.text
    return lines[::2]


class Peer:
    """Test node that publishes and subscribes; `received` contains the messages by topic."""

    def __init__(self, node: Node, executor: SingleThreadedExecutor) -> None:
        self.node = node
        self.received: dict[str, list[Any]] = {}
        self._executor = executor
        self._publishers: dict[str, Any] = {}

    def listen(
        self, topic: str, message_type: type, qos: QoSProfile | int | None = None
    ) -> Subscription:
        """Collect the messages of a topic in `received`; `qos` is `map_qos()` by default."""
        messages = self.received.setdefault(topic, [])
        return self.node.create_subscription(message_type, topic, messages.append, qos or map_qos())

    def publish(self, topic: str, message: Any, qos: QoSProfile | int | None = None) -> None:
        """Wait for a subscriber, then publish a message; `qos` is `map_qos()` by default."""
        if topic not in self._publishers:
            self._publishers[topic] = self.node.create_publisher(
                type(message), topic, qos or map_qos()
            )
        publisher = self._publishers[topic]
        self.wait_until(publisher.get_subscription_count, f"a subscriber of {topic}")
        publisher.publish(message)

    def wait_until(self, condition: Callable[[], object], what: str) -> None:
        """Spin until `condition()` is true; fail after `TIMEOUT` with `what` in the error."""
        wait_until(condition, what, step=lambda: self._executor.spin_once(timeout_sec=0.05))

    def spin(self, seconds: float) -> None:
        """Process callbacks for a time [s]."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self._executor.spin_once(timeout_sec=0.05)

    def expect(self, topic: str, count: int = 1) -> Any:
        """Wait for `count` messages on a topic; return the last message."""
        messages = self.received[topic]
        self.wait_until(lambda: len(messages) >= count, f"message {count} on {topic}")
        return messages[-1]


@contextmanager
def peer(domain: int | None = None) -> Iterator[Peer]:
    """Return a context manager for a `Peer`; the default domain is that of the test process."""
    context = Context()
    with patch.dict(os.environ, environment(domain), clear=True):
        rclpy.init(context=context)
        # Some settings are read only when the first node is created.
        node = Node("peer", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield Peer(node, executor)
    finally:
        executor.shutdown()
        node.destroy_node()
        try_shutdown(context=context)
