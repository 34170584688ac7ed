# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Reports of nodes on `/diagnostics`."""

from collections.abc import Callable

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from conftest import Start
from grid_map_ros_py.testing import Peer


@pytest.fixture
def status(other_side: Peer) -> Callable[[], DiagnosticStatus]:
    """Function that waits for the next report, and returns it."""
    other_side.listen("/diagnostics", DiagnosticArray, 10)
    reports = other_side.received["/diagnostics"]

    def wait() -> DiagnosticStatus:
        return other_side.expect("/diagnostics", len(reports) + 1).status[0]

    return wait


def test_idle_node_reports_while_its_clock_stands_still(start: Start, status) -> None:
    start("living.py", "idle", "--ros-args", "-p", "use_sim_time:=true", "-r", "__ns:=/robot")
    for _ in range(2):
        found = status()
        assert (found.name, found.level) == ("robot/being", DiagnosticStatus.OK)
        assert {value.key: value.value for value in found.values}["maps in"] == "0"


@pytest.mark.parametrize(
    ("habit", "text"),
    [
        ("misconfigured", "filter 3 'smooth': unknown parameter 'radiu'"),
        ("buggy", "a bug"),
        ("gives up", "the battery is empty"),
        ("buggy while it lives", "a bug"),
    ],
)
def test_node_that_fails_reports_why_before_it_ends(
    start: Start, status, habit: str, text: str
) -> None:
    process = start("living.py", habit)
    found = status()
    assert (found.name, found.level, found.message) == ("being", DiagnosticStatus.ERROR, text)
    assert process.wait() == 1
