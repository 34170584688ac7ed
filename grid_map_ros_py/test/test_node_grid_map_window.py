# SPDX-License-Identifier: BSD-3-Clause
"""The `grid_map_window` node as a process: windows around a robot, and maps merged into a store."""

import fcntl
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from sites import make_site
from test_poses import pose

from conftest import arguments
from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.tiled import TiledMap, open_map
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, to_message, to_stamp
from grid_map_ros_py.testing import Peer, Process, running_node, start_node, wait_until

MODULE = "grid_map_ros_py._executables.grid_map_window"

pytestmark = pytest.mark.needs("xarray", "zarr", "dask")


def odometry(x: float, y: float, stamp: int = 8, frame_id: str = "map") -> Odometry:
    return pose(1e-9 * stamp, x, y, kind=Odometry, frame_id=frame_id)


def options(path: Path, **parameters: Any) -> list[str]:
    return arguments(source=path, pose_source="odometry", **{"rate": 50.0, **parameters})


def assert_window(message: GridMapMessage, whole: GridMap, position: Any, cells: int) -> None:
    """Compare a window with the values of the whole map at the centers of its cells."""
    found = from_message(message)
    assert found.size == (cells, cells)
    assert found.frame_id == whole.frame_id
    assert np.abs(found.position - position).max() <= 0.5 * whole.resolution + 1e-9
    assert found.basic_layers == tuple(n for n in whole.basic_layers if n in found)
    centers = found.get_positions()
    inside = whole.is_inside(centers)
    for name in found:
        expected = np.full(len(centers), np.nan, np.float32)
        expected[inside] = whole.at_position(name, centers[inside])
        np.testing.assert_array_equal(found[name].ravel("F"), expected)


def text_appears(other: Peer, node: Process, text: str) -> None:
    other.wait_until(lambda: text in node.text, text)


def test_window_follows_the_robot_over_borders_and_damage(other_side: Peer, tmp_path: Path) -> None:
    whole = make_site(tmp_path / "site.zarr")
    other_side.listen("/grid_map", GridMapMessage)
    with running_node(MODULE, *options(tmp_path / "site.zarr", length=6.5, step=0.5)) as node:
        other_side.publish("/odom", odometry(105.0, -52.0, stamp=7))
        first = other_side.expect("/grid_map")
        assert_window(first, whole, (105.0, -52.0), 65)
        assert first.header.stamp == to_stamp(7)
        assert first.layers == ["elevation", "variance"]
        for number in range(40):
            other_side.publish("/odom", odometry(105.0 + 0.01 * number, -52.0))
        other_side.publish("/odom", odometry(105.0, -52.51))
        assert_window(other_side.expect("/grid_map", 2), whole, (105.0, -52.51), 65)

        # A border, a corner, and a place from which nothing of the map is seen.
        places = [(119.0, -50.0), (79.99, -62.6), (500.0, 3.0)]
        for number, place in enumerate(places, start=3):
            other_side.publish("/odom", odometry(*place))
            window = other_side.expect("/grid_map", number)
            assert_window(window, whole, place, 65)
            is_empty = np.isnan(from_message(window)["elevation"]).all()
            assert is_empty == (place == places[-1])
        text_appears(other_side, node, "the robot is off the map: it is at")

        other_side.publish("/odom", odometry(105.0, -52.0, frame_id="odom"))
        text_appears(other_side, node, "dropped a pose: header.frame_id: expected 'map', that of")
        (tmp_path / "site.zarr" / "elevation" / "0.0").write_bytes(bytes(100))
        other_side.publish("/odom", odometry(118.0, -39.0))
        text_appears(other_side, node, "dropped a message for /grid_map: ")
        assert "site.zarr/elevation: cannot be read" in node.text
        other_side.publish("/odom", odometry(90.0, -50.0))
        assert_window(other_side.expect("/grid_map", 6), whole, (90.0, -50.0), 65)


def test_last_window_shows_the_last_pose(other_side: Peer, tmp_path: Path) -> None:
    whole = make_site(tmp_path / "site.zarr")
    other_side.listen("/local", GridMapMessage)
    where = {"rate": 10.0, "step": 0.0, "length": 4.0, "output_topic": "/local"}
    given = options(tmp_path / "site.zarr", layers="[variance]", **where)
    with running_node(MODULE, *given):
        for number in range(60):
            other_side.publish("/odom", odometry(95.0 + 0.1 * number, -50.0, stamp=number))
            other_side.spin(0.01)
        messages = other_side.received["/local"]
        last = to_stamp(59)
        other_side.wait_until(
            lambda: messages and messages[-1].header.stamp == last, "the window of the last pose"
        )
        assert len(messages) >= 2
        assert_window(messages[-1], whole, (95.0 + 5.9, -50.0), 40)
        assert messages[-1].layers == ["variance"]


def part_of_survey(x: float, seed: int, frame_id: str = "map") -> GridMap:
    """Return a rolling map, moved in its buffer, with a layer that the store lacks."""
    grid_map = GridMap((3.0, 2.0), 0.1, frame_id=frame_id, layers={"elevation": 0.0, "color": 1.0})
    grid_map.move((x, 0.0))
    random = np.random.default_rng(seed)
    grid_map["elevation"] = random.random(grid_map.size)
    grid_map["elevation"][random.random(grid_map.size) < 0.2] = np.nan
    return grid_map


def merged(whole: GridMap, other: GridMap) -> GridMap:
    whole.add_data_from(other, extend_map=False, overwrite_data=True, layers=["elevation"])
    return whole


def ignores_sigterm(node: Process) -> bool:
    """Return whether a node ends: it no longer takes signals."""
    status = Path(f"/proc/{node.pid}/status").read_text()
    ignored = int(status.partition("SigIgn:")[2].split()[0], 16)
    return bool(ignored >> (signal.SIGTERM - 1) & 1)


def test_merged_maps_are_in_windows_and_kept_at_the_end(other_side: Peer, tmp_path: Path) -> None:
    path, geometry = tmp_path / "site.zarr", GridGeometry((100.0, 60.0), 0.1)
    TiledMap.create(path, geometry, ["elevation", "variance"], chunks=32)
    whole = GridMap.from_geometry(geometry, frame_id="map")
    whole["elevation"] = whole["variance"] = np.nan
    counts: dict[str, str] = {}

    def note(message: DiagnosticArray) -> None:
        counts.update({pair.key: pair.value for s in message.status for pair in s.values})

    other_side.node.create_subscription(DiagnosticArray, "/diagnostics", note, 10)
    other_side.listen("/grid_map", GridMapMessage)
    write = {"write_back": True, "write_topic": "/survey"}
    node = start_node(MODULE, *options(path, length=12.0, **write))
    try:
        other_side.publish("/odom", odometry(5.0, 0.3))
        assert_window(other_side.expect("/grid_map"), whole, (5.0, 0.3), 120)
        maps = [part_of_survey(x, seed) for seed, x in enumerate((3.0, 4.6, 0.0, 8.0))]
        for number, grid_map in enumerate(maps[:2], start=2):
            other_side.publish("/survey", to_message(grid_map))
            # The robot stands still: only the new cells are a reason for a window.
            window = other_side.expect("/grid_map", number)
            assert_window(window, merged(whole, grid_map), (5.0, 0.3), 120)

        other_side.publish("/survey", to_message(part_of_survey(0.0, 9, frame_id="odom")))
        text_appears(other_side, node, "did not merge a map of /survey: ")
        assert "'odom'" in node.text
        without = part_of_survey(0.0, 9).without_layers(["elevation"])
        other_side.publish("/survey", to_message(without))
        text_appears(other_side, node, "layers: expected one of ['elevation', 'variance'], got")
        other_side.wait_until(lambda: counts.get("maps dropped") == "2", "two dropped maps")

        # While another process holds the store, a map is in work and the next one waits.
        with (path / ".zgroup").open("r+") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX)
            for number, grid_map in enumerate(maps[2:], start=5):
                other_side.publish("/survey", to_message(grid_map))
                other_side.wait_until(
                    lambda: counts.get("maps in") == str(number),  # noqa: B023
                    "the map to arrive",
                )
            assert counts["maps out"] == "2"
            other_side.publish("/odom", odometry(6.0, 0.3))
            assert_window(other_side.expect("/grid_map", 4), whole, (6.0, 0.3), 120)
            node.terminate()
            wait_until(lambda: ignores_sigterm(node), "the end of the node to begin")
            fcntl.flock(stream, fcntl.LOCK_UN)
        assert node.wait() == 0, node.text
        assert "Traceback" not in node.text, node.text
        for grid_map in maps[2:]:
            merged(whole, grid_map)
        stored = open_map(path).to_map()
        np.testing.assert_array_equal(stored["elevation"], whole.unwrapped("elevation"))
    finally:
        node.stop()
