# SPDX-License-Identifier: BSD-3-Clause
"""Node `costmap` without optional messages; test/costmaps.py has the tests with them."""

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import OccupancyGrid
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from test_costs import costs

from conftest import arguments, call
from grid_map_core_py.conversions import CostRange
from grid_map_ros_py import to_message, to_occupancy_grid
from grid_map_ros_py.nodes._poses import has_tf
from grid_map_ros_py.testing import Peer, running_node

MODULE = "grid_map_ros_py._executables.costmap"


def set_parameters(peer: Peer, *, node: str = "costmap", **values: object) -> list[str]:
    """Set parameters one by one; return the reasons of the refused ones."""
    changes = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    results = call(peer, SetParameters, f"/{node}/set_parameters", parameters=changes).results
    return [result.reason for result in results if not result.successful]


def wait_for_level(peer: Peer, level: bytes) -> DiagnosticStatus:
    reports = peer.received["/diagnostics"]
    peer.wait_until(lambda: reports and reports[-1].status[0].level == level, f"level {level!r}")
    return reports[-1].status[0]


GOOD = costs((30, 20))
WRONG = GOOD.with_layers({"height": GOOD["cost"]}).without_layers(["cost"])
FRACTIONS = GOOD.with_layers({"cost": np.full((30, 20), 0.7)})


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (WRONG, "no layer 'cost'; available: height"),
        (FRACTIONS, "layer 'cost': expected whole costs from 0 to 254 or NaN, got 0.7. Compute"),
        pytest.param(
            costs((3, 4), frame_id="map"),
            "the costmap in frame 'odom' of a map in frame 'map' needs the package 'tf2_ros'",
            marks=pytest.mark.skipif(has_tf(), reason="test/costmaps.py has the test with tf2"),
        ),
    ],
)
def test_unusable_map_is_named_and_the_next_is_sent(other_side: Peer, wrong, text: str) -> None:
    other_side.listen("/costmap", OccupancyGrid)
    other_side.listen("/diagnostics", DiagnosticArray, 10)
    with running_node(MODULE, *arguments(frame_id="/odom")) as node:
        for _ in range(3):
            other_side.publish("/grid_map", to_message(wrong))
        line = f"dropped a message of /grid_map: {text}"
        other_side.wait_until(lambda: line in node.text, line)
        values = wait_for_level(other_side, DiagnosticStatus.ERROR).values
        assert any(value.value.startswith(text) for value in values if value.key == "last error")
        other_side.publish("/grid_map", to_message(GOOD))
        assert other_side.expect("/costmap") == to_occupancy_grid(GOOD, "cost", codec=CostRange())
        wait_for_level(other_side, DiagnosticStatus.OK)
        assert len(other_side.received["/costmap"]) == 1


def test_parameters_apply_to_the_latched_map_at_once(other_side: Peer) -> None:
    other_side.listen("/costmap", OccupancyGrid)
    grid_map = GOOD.with_layers({"other": np.full((30, 20), 254.0)})
    with running_node(MODULE, *arguments(always_send_full=True)):
        other_side.publish("/grid_map", to_message(grid_map))
        other_side.expect("/costmap")
        assert set_parameters(other_side, layer="other") == []
        assert set(other_side.expect("/costmap", 2).data) == {100}
        wrong = {"origin_grid": 0, "layer": 3, "unknown": "free", "stale_after": -1.0}
        wrong |= {"resolution": 1e30}
        for name, reason in zip(wrong, set_parameters(other_side, **wrong), strict=True):
            assert reason.startswith(f"parameter {name!r}: expected ")
        assert set_parameters(other_side, resolution=1) == []
        assert other_side.expect("/costmap", 3).info.width == 4
        assert set_parameters(other_side, resolution=0.1, origin_grid=3) == []
        info = other_side.expect("/costmap", 5).info
        assert (info.width, info.height) == (30, 18)


def test_only_changed_costs_are_sent_on_an_aligned_grid(other_side: Peer) -> None:
    """The position of the map is a multiple of the resolution, its origin is not."""
    other_side.listen("/costmap", OccupancyGrid)
    other_side.listen("/diagnostics", DiagnosticArray, 10)
    grid_map, reports = costs((31, 20)), other_side.received["/diagnostics"]

    def has_used_two_maps() -> bool:
        return any(report.status[0].values[1].value == "2" for report in reports)

    with running_node(MODULE, *arguments()) as node:
        other_side.publish("/grid_map", to_message(grid_map))
        info = other_side.expect("/costmap").info
        assert (info.width, info.height) == (32, 20)
        assert info.origin.position.x == pytest.approx(-1.3, abs=1e-9)
        other_side.publish("/grid_map", to_message(grid_map))
        other_side.wait_until(has_used_two_maps, "the second map")
        grid_map["cost"] = 0.0
        other_side.publish("/grid_map", to_message(grid_map))
        assert set(other_side.expect("/costmap", 2).data) == {0}
        assert len(other_side.received["/costmap"]) == 2
        assert "trinary_costmap to false and subscribe_to_updates to true" in node.text
