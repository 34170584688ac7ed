# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How an executable ends."""

import signal
import subprocess

import pytest
from conftest import Start

TIMEOUT = 30.0


def wait_until_alive(process: subprocess.Popen[str]) -> None:
    assert process.stdout is not None
    assert process.stdout.readline() == "alive\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("habit", ["idle", "busy", "slow"])
def test_a_signal_ends_the_node_in_peace_whatever_it_does(
    start: Start, habit: str, number: signal.Signals
) -> None:
    process = start("living.py", habit)
    wait_until_alive(process)
    process.send_signal(number)
    out, errors = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, out, errors) == (0, "destroyed\n", "")


def test_interrupts_while_the_node_ends_change_nothing(start: Start) -> None:
    process = start("living.py", "idle")
    wait_until_alive(process)
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(0.01)
        except subprocess.TimeoutExpired:
            continue
    out, errors = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, out, errors) == (0, "destroyed\n", "")


def test_a_node_that_cannot_work_says_so_once_and_fails(start: Start) -> None:
    process = start("living.py", "misconfigured")
    _, errors = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert errors.count("\n") == 1
    assert errors.startswith("[FATAL]")
    assert errors.endswith("[living]: filter 3 'smooth': unknown parameter 'radiu'\n")


def test_a_bug_is_not_hidden(start: Start) -> None:
    process = start("living.py", "buggy")
    _, errors = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert errors.endswith("ZeroDivisionError: a bug\n")


def test_arguments_that_ros_does_not_know_are_reported_without_a_traceback(start: Start) -> None:
    process = start("living.py", "idle", "--ros-args", "--nonsense")
    _, errors = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert "--nonsense" in errors
    assert "Traceback" not in errors
