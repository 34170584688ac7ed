# SPDX-License-Identifier: BSD-3-Clause
"""Helpers of tests: domains of their own, and the output of processes."""

import pytest

from grid_map_ros_py import testing


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
