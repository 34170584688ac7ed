# SPDX-License-Identifier: BSD-3-Clause
"""Reports of nodes on `/diagnostics`."""

from itertools import count
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from test_grid_map import sample_map

from conftest import Start, arguments
from grid_map_ros_py import to_message
from grid_map_ros_py.testing import Peer, running_node, wait_until


def values(report: DiagnosticArray) -> dict[str, str]:
    return {value.key: value.value for value in report.status[0].values}


def test_idle_node_reports_while_its_clock_stands_still(start: Start, other_side: Peer) -> None:
    other_side.listen("/diagnostics", DiagnosticArray, 10)
    start("living.py", "idle", "--ros-args", "-p", "use_sim_time:=true", "-r", "__ns:=/robot")
    for number in (1, 2):
        found = other_side.expect("/diagnostics", number)
        assert found.status[0].name == "robot/being"
        assert found.status[0].level == DiagnosticStatus.OK
        assert values(found)["maps in"] == "0"


def test_flood_of_wrong_maps_is_counted_in_few_short_lines(
    other_side: Peer, tmp_path: Path
) -> None:
    other_side.listen("/diagnostics", DiagnosticArray, 10)
    reports = other_side.received["/diagnostics"]
    numbers = count()

    def send_wrong_map() -> None:
        message = to_message(sample_map())
        message.basic_layers = [f"{next(numbers)}{'x' * 10**6}"]
        other_side.publish("/grid_map", message)
        other_side.spin(0.01)

    def last() -> dict[str, str]:
        return values(reports[-1])

    with running_node(
        "grid_map_ros_py._executables.grid_map_saver",
        *arguments(file_path=tmp_path / "bag", continuous=True),
    ) as node:
        send_wrong_map()
        other_side.expect("/diagnostics")
        wait_until(lambda: int(last()["maps dropped"]) > 50, "a flood", step=send_wrong_map)
        other_side.publish("/grid_map", to_message(sample_map()))
        other_side.wait_until(lambda: last()["maps out"] == "1", "the map that is right")
        dropped = int(last()["maps dropped"])
        assert int(last()["maps in"]) == 1 + dropped
        assert len(last()["last error"]) <= 500
    assert max(len(line) for line in node.lines if "ERROR" in line) < 700
