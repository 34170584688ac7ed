# SPDX-License-Identifier: BSD-3-Clause
"""Helpers of tests: domains of their own, and the output of processes."""

import socket
import subprocess
import sys
from contextlib import ExitStack, suppress

import pytest

from grid_map_ros_py import testing

RESERVE = """
import os
os.getpid = lambda: {}
from grid_map_ros_py.testing import reserved_domain
print(reserved_domain()[0], flush=True)
input()
"""


def test_processes_that_want_the_same_domain_get_different_ones() -> None:
    with ExitStack() as stack:
        processes = [
            stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-c", RESERVE.format(41)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    text=True,
                )
            )
            for _ in range(3)
        ]
        domains = {int(process.stdout.readline()) for process in processes if process.stdout}
        for process in processes:
            process.communicate("\n", timeout=testing.TIMEOUT)
    assert len(domains) == 3
    assert domains <= set(range(1, testing.DOMAINS + 1))


def test_domain_of_the_caller_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    first, lock = testing.reserve_domain()
    lock.close()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(first))
    second, lock = testing.reserve_domain()
    lock.close()
    assert second != first


def test_processes_do_not_depend_on_variables_of_the_shell(monkeypatch) -> None:
    usual = testing.environment()
    assert usual["ROS_DOMAIN_ID"] == str(testing.reserved_domain()[0])
    for name, value in {
        "ROS_DOMAIN_ID": "55",
        "ROS_LOCALHOST_ONLY": "1",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
        "ROS_DISCOVERY_SERVER": "127.0.0.1:11811",
        "RCUTILS_CONSOLE_OUTPUT_FORMAT": "{message}",
    }.items():
        monkeypatch.setenv(name, value)
    assert testing.environment() == usual


def test_machine_without_a_free_domain_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(testing, "DOMAINS", 1)
    with socket.socket() as taken:
        # A domain is also in use if another process has its port.
        with suppress(OSError):
            taken.bind(("", testing.LOCK_PORTS + 1))
        with pytest.raises(RuntimeError, match="all 1 ROS domains are taken by other tests"):
            testing.reserved_domain.__wrapped__()


def test_output_leaves_out_races_for_ports() -> None:
    log = "RTPS_TRANSPORT_SHM Error] Failed init_port fastrtps_port7003: open_and_lock_file failed"
    process = testing.Process([sys.executable, "-c", f"print({log!r}); print('ready')"])
    assert process.wait() == 0
    assert process.lines == ["ready\n"]
