# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the node `costmap` with the messages of Nav2, run by test_optional_messages.py."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from map_msgs.msg import OccupancyGridUpdate
from nav2_msgs.msg import Costmap, CostmapUpdate
from nav2_msgs.srv import GetCostmap
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import QoSProfile
from tf2_msgs.msg import TFMessage

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import CostRange
from grid_map_ros_py import apply_update, to_costmap, to_message, to_occupancy_grid
from grid_map_ros_py._costs import Planar, resampled
from grid_map_ros_py.messages import to_stamp, to_transform
from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.nodes._poses import from_xyz_rpy
from grid_map_ros_py.testing import Peer, Process, peer, running_node

MODULE = "grid_map_ros_py._executables.costmap"
KINDS = {
    "/costmap": (OccupancyGrid, OccupancyGridUpdate),
    "/costmap_raw": (Costmap, CostmapUpdate),
}


def deep() -> QoSProfile:
    qos = map_qos()
    qos.depth = 10
    return qos


def place(info: Any) -> list[float]:
    """Return the origin [m], rounded to nanometers."""
    return np.round([info.origin.position.x, info.origin.position.y], 9).tolist()


class Replay:
    """Subscribers that apply every update to the last full grid, in the order of arrival."""

    def __init__(self, other: Peer) -> None:
        self.peer = other
        self.grids: dict[str, Any] = {}
        self.counts: dict[str, int] = {}
        for topic, (full, update) in KINDS.items():
            for name, kind in ((topic, full), (f"{topic}_updates", update)):
                self.counts[name] = 0
                other.node.create_subscription(kind, name, self._receiver(topic, name), deep())

    def _receiver(self, topic: str, name: str) -> Any:
        def receive(message: Any) -> None:
            self.counts[name] += 1
            if name == topic:
                self.grids[topic] = message
            elif topic in self.grids:
                self.grids[topic] = apply_update(self.grids[topic], message)

        return receive

    def wait_for(self, grid_map: GridMap) -> None:
        """Wait until both grids have exactly the costs of a map."""
        grid = to_occupancy_grid(grid_map, "cost", codec=CostRange())
        raw = to_costmap(grid_map, "cost")

        def is_equal() -> bool:
            found, found_raw = (self.grids.get(topic) for topic in KINDS)
            return bool(
                found
                and found_raw
                and (found.data, found_raw.data) == (grid.data, raw.data)
                and place(found.info) == place(grid.info)
                and place(found_raw.metadata) == place(raw.metadata)
            )

        self.peer.wait_until(is_equal, "the costs")


@contextmanager
def costmap(**parameters: object) -> Iterator[tuple[Process, Replay]]:
    words = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    with peer() as other, running_node(MODULE, "--ros-args", *words) as node:
        yield node, Replay(other)


def costs(frame_id: str = "odom") -> GridMap:
    """Return a map with random costs, some of them unknown."""
    grid_map = GridMap((3.0, 2.0), 0.1, layers={"cost": 0.0}, frame_id=frame_id, timestamp=10**9)
    grid_map.move((0.3, -0.2))
    grid_map["cost"] = np.random.default_rng(1).integers(0, 255, grid_map.size)
    grid_map["cost"][3:7, 2:9] = np.nan
    return grid_map


def edit(grid_map: GridMap, random: np.random.Generator) -> None:
    row, column = (int(random.integers(0, count)) for count in grid_map.size)
    cells = slice(row, row + 4), slice(column, column + 3)
    grid_map["cost"][cells] = random.choice([0, 17, 252, 253, 254, math.nan])


def test_updates_replay_to_the_present_costs() -> None:
    grid_map, random = costs(), np.random.default_rng(2)
    with costmap(full_period=1000.0) as (_, replay):
        for _ in range(60):
            replay.peer.publish("/grid_map", to_message(grid_map))
            replay.wait_for(grid_map)
            edit(grid_map, random)
        assert replay.counts["/costmap"] == replay.counts["/costmap_raw"] == 1
        assert 40 < replay.counts["/costmap_raw_updates"] < 60
        assert 30 < replay.counts["/costmap_updates"] < 60
        before = replay.counts.copy()
        client = replay.peer.node.create_client(GetCostmap, "/get_costmap")
        replay.peer.wait_until(client.service_is_ready, "the service")
        answer = client.call_async(GetCostmap.Request())
        replay.peer.wait_until(answer.done, "the answer")
        assert answer.result().map.data == replay.grids["/costmap_raw"].data
        assert replay.counts == before


@pytest.mark.parametrize("step", [1, 10])
def test_rolling_map_sends_full_grids_only_if_its_window_moves(step: int) -> None:
    grid_map = costs()
    windows = set()
    with costmap(full_period=1000.0, origin_grid=step) as (_, replay):
        for number in range(12):
            grid_map.move((0.1 * number, 0.0))
            grid_map["cost"] = np.where(np.isnan(grid_map["cost"]), 1.0 + number, 254.0)
            grid_map["cost"][2, 1] = number
            lower = np.rint((grid_map.position - 0.5 * grid_map.length) / 0.1).astype(int)
            first = -(-lower // step) * step
            last = (lower + grid_map.size) // step * step
            center, length = 0.05 * (first + last), 0.1 * (last - first)
            replay.peer.publish("/grid_map", to_message(grid_map))
            replay.wait_for(grid_map.get_submap(center, length))
            windows.add((*first, *last))
        assert replay.counts["/costmap"] == len(windows) == {1: 12, 10: 3}[step]


def test_late_subscriber_has_the_present_costs_after_full_period() -> None:
    grid_map, random = costs(), np.random.default_rng(3)
    with costmap(full_period=2.0) as (_, replay):
        for moved in (0.0, 0.5):
            grid_map.move((moved, 0.0))
            grid_map["cost"] = 7.0
            for _ in range(15):
                replay.peer.publish("/grid_map", to_message(grid_map))
                replay.wait_for(grid_map)
                edit(grid_map, random)
            # The updates before this full grid are those of another window.
            grid_map.move((moved + 1.0, 0.3))
            grid_map["cost"] = 9.0
            replay.peer.publish("/grid_map", to_message(grid_map))
            replay.wait_for(grid_map)
            with peer() as other:
                late = Replay(other)
                # The latched grid comes first, and twice again after the last update.
                other.wait_until(lambda: late.counts["/costmap"] == 3, "full grids")  # noqa: B023
                late.wait_for(grid_map)
            with peer() as other:
                late = Replay(other)
                late.wait_for(grid_map)
                assert late.counts["/costmap_updates"] == 0


def test_outdated_costs_become_unknown_and_come_back_in_full() -> None:
    unknown = costs()
    unknown["cost"] = np.nan
    with costmap(stale_after=2.0, full_period=0.5) as (node, replay):
        replay.peer.listen("/diagnostics", DiagnosticArray, 10)
        reports = replay.peer.received["/diagnostics"]
        for _ in range(2):
            full = replay.counts["/costmap"]
            replay.peer.publish("/grid_map", to_message(costs()))
            replay.wait_for(costs())
            assert replay.counts["/costmap"] == full + 1
            assert replay.counts["/costmap_updates"] == 0
            replay.wait_for(unknown)
            replay.peer.wait_until(
                lambda: reports and reports[-1].status[0].level == DiagnosticStatus.WARN, "WARN"
            )
        assert node.text.count("no usable map of /grid_map for 2 s, all cells are unknown") == 2


def test_rotated_frame_gets_the_worst_costs_once_its_transform_arrives() -> None:
    with costmap(frame_id="map", unknown="above_free") as (node, replay):
        source = costs()
        replay.peer.publish("/grid_map", to_message(source))
        text = (
            "dropped a message of /grid_map: frame_id: expected a transform from 'odom' to 'map', "
            "got none within 1 s: 'odom' passed to lookupTransform does not exist. Publish it"
        )
        replay.peer.wait_until(lambda: text in node.text, "the missing transform")
        assert replay.counts["/costmap"] == 0
        qos = deep()
        for tilt, yaw in ((0.2, 0.5), (0.0, 0.5), (0.0, -2.0)):
            transform = TransformStamped(child_frame_id="odom")
            transform.header.frame_id, transform.header.stamp = "map", to_stamp(10**9)
            transform.transform = to_transform(from_xyz_rpy((1.0, -2.0, 0.3), (tilt, 0.0, yaw)))
            replay.peer.publish("/tf_static", TFMessage(transforms=[transform]), qos)
            # A transform may arrive after its map.
            replay.peer.publish("/grid_map", to_message(source))
            if tilt:
                text = "frame 'odom': expected roll and pitch of at most 5 deg in 'map', got 11.5"
                replay.peer.wait_until(lambda: text in node.text, "the tilt")  # noqa: B023
                assert replay.counts["/costmap"] == 0
                continue
            expected = resampled(
                source, "cost", Planar(1.0, -2.0, yaw), "map", 0.1, unknown_is_worst=False
            )

            def has_come(expected: GridMap = expected) -> bool:
                replay.peer.publish("/grid_map", to_message(source))
                found = replay.grids.get("/costmap_raw")
                return bool(found) and found.data == to_costmap(expected, "cost").data

            replay.peer.wait_until(has_come, "the costs in the map frame")
            assert replay.grids["/costmap_raw"].header.frame_id == "map"
