# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the `costmap` node with the messages of Nav2, run by test_optional_messages.py."""

import itertools
import math
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from map_msgs.msg import OccupancyGridUpdate
from nav2_msgs.msg import Costmap, CostmapUpdate
from nav2_msgs.srv import GetCostmap
from nav_msgs.msg import OccupancyGrid
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from tf2_msgs.msg import TFMessage

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import CostRange
from grid_map_ros_py import apply_update, from_costmap, to_costmap, to_message, to_occupancy_grid
from grid_map_ros_py._costs import resampled
from grid_map_ros_py.messages import serialize, to_stamp, to_transform
from grid_map_ros_py.messages._updates import is_same_grid
from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.nodes._poses import from_xyz_rpy
from grid_map_ros_py.testing import Peer, Process, peer, running_node, wait_until

MODULE = "grid_map_ros_py._executables.costmap"
KINDS = {
    "costmap": OccupancyGrid,
    "costmap_updates": OccupancyGridUpdate,
    "costmap_raw": Costmap,
    "costmap_raw_updates": CostmapUpdate,
}


class Replay:
    """Subscribers that apply every update to the last full grid, in the order of arrival."""

    def __init__(self, other: Peer) -> None:
        self.peer, self.grids = other, dict[str, Any]()
        self.counts, qos = dict.fromkeys(KINDS, 0), map_qos()
        qos.depth = 10
        for name, kind in KINDS.items():
            other.node.create_subscription(kind, name, partial(self._receive, name), qos)

    def _receive(self, name: str, message: Any) -> None:
        self.counts[name] += 1
        topic = name.removesuffix("_updates")
        if topic == name:
            self.grids[topic] = message
        elif topic in self.grids:
            self.grids[topic] = apply_update(self.grids[topic], message)

    def wait_for(self, grid_map: GridMap) -> None:
        """Wait until both grids have exactly the costs of a map, in its first layer."""
        layer = grid_map.layers[0]
        grids = {
            "costmap": to_occupancy_grid(grid_map, layer, codec=CostRange()),
            "costmap_raw": to_costmap(grid_map, layer),
        }

        def has_come(topic: str) -> bool:
            found, grid = self.grids.get(topic), grids[topic]
            return found is not None and found.data == grid.data and is_same_grid(found, grid)

        self.peer.wait_until(lambda: all(map(has_come, grids)), "the costs")

    def send(self, grid_map: GridMap, expected: GridMap | None = None) -> None:
        self.peer.publish("/grid_map", to_message(grid_map))
        self.wait_for(expected or grid_map)


@contextmanager
def costmap(**parameters: object) -> Iterator[tuple[Process, Replay]]:
    words = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
    with peer() as other, running_node(MODULE, "--ros-args", *words) as node:
        yield node, Replay(other)


def call(other: Peer, name: str, kind: type, **request: object) -> Any:
    """Call a service, and return its answer."""
    client = other.node.create_client(kind, name)
    other.wait_until(client.service_is_ready, name)
    answer = client.call_async(kind.Request(**request))
    other.wait_until(answer.done, f"an answer of {name}")
    return answer.result()


def set_parameter(other: Peer, name: str, value: object) -> None:
    parameters = [Parameter(name, value=value).to_parameter_msg()]
    (result,) = call(other, "/costmap/set_parameters", SetParameters, parameters=parameters).results
    assert result.successful, result.reason


def costs() -> GridMap:
    """Return a moved map with random costs, some of them unknown."""
    grid_map = GridMap((3.0, 2.0), 0.1, layers={"cost": 0.0}, frame_id="odom", timestamp=10**9)
    grid_map.move((0.3, -0.2))
    grid_map["cost"] = np.random.default_rng(1).integers(0, 255, grid_map.size)
    grid_map["cost"][3:7, 2:9] = np.nan
    return grid_map


def edited(grid_map: GridMap, number: int) -> GridMap:
    random = np.random.default_rng(number)
    row, column = random.integers(0, grid_map.size).tolist()
    grid_map["cost"][row : row + 4, column : column + 3] = random.choice([0, 17, 254, math.nan])
    return grid_map


def test_updates_replay_to_the_present_costs() -> None:
    grid_map = costs()
    with costmap(full_period=1000.0) as (node, replay):
        assert call(replay.peer, "/get_costmap", GetCostmap).map == Costmap()
        warning = "get_costmap: no costs yet, as no map of /grid_map has been used"
        replay.peer.wait_until(lambda: warning in node.text, warning)
        for number in range(60):
            replay.send(edited(grid_map, number))
        assert replay.counts["costmap"] == replay.counts["costmap_raw"] == 1
        assert 40 < replay.counts["costmap_updates"] <= replay.counts["costmap_raw_updates"] < 60
        raw = replay.grids["costmap_raw"]
        assert raw == deserialize_message(serialize(raw), Costmap)
        received = from_costmap(raw, "cost")
        np.testing.assert_array_equal(received["cost"], grid_map.unwrapped("cost"))
        assert call(replay.peer, "/get_costmap", GetCostmap).map.data == raw.data


@pytest.mark.parametrize(("step", "count"), [(1, 12), (10, 3)])
def test_rolling_map_sends_full_grids_if_its_window_moves(step: int, count: int) -> None:
    grid_map = costs()
    with costmap(full_period=1000.0, origin_grid=step) as (_, replay):
        for number in range(12):
            grid_map.move((0.1 * number, 0.0))
            grid_map["cost"] = float(number)
            lower = np.rint((grid_map.position - 0.5 * grid_map.length) / 0.1).astype(int)
            first, last = -(-lower // step) * step, (lower + grid_map.size) // step * step
            window = grid_map.get_submap(0.05 * (first + last), 0.1 * (last - first))
            replay.send(grid_map, window)
        assert replay.counts["costmap"] == replay.counts["costmap_raw"] == count


def test_late_subscriber_has_the_present_costs_within_full_period() -> None:
    grid_map = costs()
    with costmap(full_period=2.0) as (_, replay):
        for number in range(15):
            replay.send(edited(grid_map, number))
        # The latched updates are those of another window.
        grid_map.move((1.0, 0.3))
        grid_map["cost"] = 9.0
        replay.send(grid_map)

        def gets_no_old_updates() -> bool:
            with peer() as other:
                late = Replay(other)
                late.wait_for(grid_map)
                return late.counts["costmap_updates"] == late.counts["costmap_raw_updates"] == 0

        wait_until(gets_no_old_updates, "a late subscriber without updates of another window")


def test_stale_costs_become_unknown_and_return_in_full() -> None:
    """A late subscriber gets no older update, though `stale_after` is lowered after one."""
    unknown, text = costs(), "no usable map of /grid_map for 2 s, so all cells are unknown"
    unknown["cost"] = np.nan
    with costmap(full_period=1000.0, stale_after=0.0) as (node, replay), peer() as other:
        replay.peer.listen("/diagnostics", DiagnosticArray, 10)
        replay.send(costs())
        replay.send(edited(costs(), 0))
        set_parameter(replay.peer, "stale_after", 2.0)
        replay.wait_for(unknown)
        late = Replay(other)
        late.wait_for(unknown)
        replay.send(costs())
        late.wait_for(costs())
        replay.send(edited(costs(), 1))
        # The latched updates of a publisher come before its later ones.
        late.wait_for(edited(costs(), 1))
        assert late.counts["costmap_updates"] == late.counts["costmap_raw_updates"] == 1
        replay.wait_for(unknown)
        reports = replay.peer.received["/diagnostics"]
        replay.peer.wait_until(
            lambda: reports and reports[-1].status[0].level == DiagnosticStatus.WARN, "a warning"
        )
        assert reports[-1].status[0].message.endswith(text)
        assert node.text.count(f"{text}; set stale_after to 0") == 2
        counts = replay.counts
        assert counts["costmap"] == counts["costmap_raw"] == 4
        assert counts["costmap_updates"] == counts["costmap_raw_updates"] == 2


def test_rotated_frame_gets_costs_once_its_transform_arrives() -> None:
    transform, message = TransformStamped(child_frame_id="odom"), to_message(costs())
    transform.header.frame_id, transform.header.stamp = "map", to_stamp(10**9)
    with costmap(frame_id="map", unknown="above_free") as (node, replay):
        replay.peer.listen("/diagnostics", DiagnosticArray, 10)
        reports = replay.peer.received["/diagnostics"]

        def has_logged(text: str) -> bool:
            replay.peer.publish("/grid_map", message)
            return any(text in line for line in node.lines)

        def has_sent_costs() -> bool:
            replay.peer.publish("/grid_map", message)
            return any(replay.counts.values())

        def publish_transform(other: Peer, roll: float) -> None:
            transform.transform = to_transform(from_xyz_rpy((1.0, -2.0, 0.3), (roll, 0.0, 0.5)))
            other.publish("/tf_static", TFMessage(transforms=[transform]))

        def levels() -> list[bytes]:
            """Return the diagnostic levels from the first error on."""
            replay.peer.publish("/grid_map", message)
            found = [report.status[0].level for report in reports]
            return list(itertools.dropwhile(lambda level: level != DiagnosticStatus.ERROR, found))

        text = (
            "dropped a message of /grid_map: frame_id: expected a transform from 'odom' to 'map', "
            "got none within 1 s: 'odom' passed to lookupTransform does not exist. Publish it"
        )
        replay.peer.wait_until(lambda: has_logged(text), "the missing transform")
        replay.peer.wait_until(lambda: len(levels()) >= 4, "four reports")
        assert set(levels()) == {DiagnosticStatus.ERROR}
        tilt = "frame 'odom': expected roll and pitch of at most 5 deg in 'map', got 11.5"
        with peer() as other:
            publish_transform(other, 0.2)
            replay.peer.wait_until(lambda: has_logged(tilt), "the tilt")
            assert all("[WARN]" in line for line in node.lines if tilt in line)
            assert not any(replay.counts.values())
            publish_transform(other, 0.0)
            # Maps that arrive before the transform are dropped.
            replay.peer.wait_until(has_sent_costs, "costs")
            replay.wait_for(resampled(costs(), "cost", (1.0, -2.0, 0.5), "map", 0.1, 0))
        # No publisher could repeat the transform.
        set_parameter(replay.peer, "layer", "other")
        grid_map = costs().with_layers({"other": np.zeros(costs().size)})
        replay.send(grid_map, resampled(grid_map, "other", (1.0, -2.0, 0.5), "map", 0.1))
