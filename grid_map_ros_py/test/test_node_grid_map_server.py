# SPDX-License-Identifier: BSD-3-Clause
"""The `grid_map_server` node as a process: topics, services, refused requests, restarts."""

from pathlib import Path
from typing import Any

import pytest
from sites import make_site
from test_grid_map import sample_map

from conftest import arguments, call
from grid_map_core_py import GridMap
from grid_map_core_py.testing import assert_maps_equal
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_msgs.srv import GetGridMap, GetGridMapInfo, ProcessFile, SetGridMap
from grid_map_ros_py import from_message, to_message
from grid_map_ros_py.bags import load_from_bag, save_to_bag
from grid_map_ros_py.testing import Peer, peer, running_node

MODULE = "grid_map_ros_py._executables.grid_map_server"
SERVICES = {
    "get_grid_map": GetGridMap,
    "get_grid_map_info": GetGridMapInfo,
    "set_grid_map": SetGridMap,
    "load_map": ProcessFile,
    "save_map": ProcessFile,
}


def ask(other: Peer, name: str, **request: Any) -> Any:
    """Call a service of the server, and return its answer."""
    return call(other, SERVICES[name], f"/grid_map_server/{name}", **request)


def map_of(timestamp: int) -> GridMap:
    grid_map = sample_map()
    grid_map.timestamp = timestamp
    return grid_map


def test_map_is_set_published_asked_for_saved_and_loaded(other_side: Peer, tmp_path: Path) -> None:
    with running_node(MODULE, *arguments(directory=tmp_path, storage="sqlite3")):
        ask(other_side, "set_grid_map", map=to_message(map_of(1)))
        other_side.listen("/grid_map", GridMapMessage)
        published = from_message(other_side.expect("/grid_map"), unwrap=False)
        assert_maps_equal(published, map_of(1))
        assert published.start_index == map_of(1).start_index

        where = {"position_x": 1.0, "position_y": -2.0, "length_x": 0.9, "length_y": 0.4}
        part = ask(other_side, "get_grid_map", frame_id="odom", layers=["variance"], **where).map
        expected = map_of(1).get_submap((1.0, -2.0), (0.9, 0.4)).without_layers(["elevation"])
        assert_maps_equal(from_message(part), expected)
        assert ask(other_side, "get_grid_map_info").info == to_message(map_of(1)).info

        assert ask(other_side, "save_map", file_path="bag").success
        assert (tmp_path / "bag" / "bag_0.db3").is_file()
        assert_maps_equal(load_from_bag(tmp_path / "bag", "/grid_map"), map_of(1))
        ask(other_side, "set_grid_map", map=to_message(map_of(2)))
        other_side.expect("/grid_map", 2)
        assert ask(other_side, "load_map", file_path=str(tmp_path / "bag")).success
        assert_maps_equal(from_message(other_side.expect("/grid_map", 3)), map_of(1))


def test_refused_request_is_logged_and_changes_nothing(other_side: Peer, tmp_path: Path) -> None:
    (tmp_path / "bags").mkdir()
    save_to_bag(map_of(3), tmp_path / "secret", "/map")
    options = arguments(directory=tmp_path / "bags", input_topic="/incoming")
    with running_node(MODULE, *options) as node:
        nothing = ask(other_side, "get_grid_map").map
        assert (nothing.layers, nothing.info.resolution) == ([], 0.0)
        assert ask(other_side, "get_grid_map_info").info.resolution == 0.0
        assert not ask(other_side, "save_map", file_path="bag").success
        other_side.publish("/incoming", to_message(map_of(1)))
        other_side.wait_until(
            lambda: ask(other_side, "get_grid_map_info").info.resolution, "the map to arrive"
        )
        malformed = to_message(map_of(2))
        malformed.info.resolution = -1.0
        ask(other_side, "set_grid_map", map=malformed)
        other_side.publish("/incoming", malformed)
        other_side.wait_until(lambda: "dropped a message" in node.text, "the bad map to be dropped")
        for request in ({"frame_id": "base"}, {"layers": ["slope"]}, {"length_x": -1.0}):
            assert ask(other_side, "get_grid_map", **request).map.info.resolution == 0.0
        for path in ("../secret", str(tmp_path / "secret"), "missing"):
            assert not ask(other_side, "load_map", file_path=path).success
        assert not ask(other_side, "save_map", file_path="../new").success
        assert_maps_equal(from_message(ask(other_side, "get_grid_map").map), map_of(1))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bags", "secret"]
    for reason in (
        "get_grid_map: there is no map yet",
        "set_grid_map: info.resolution: expected a positive finite number, got -1.0",
        "get_grid_map: frame_id: expected 'odom', that of the map, got 'base'",
        "get_grid_map: no layer 'slope'; available: elevation, variance",
        "get_grid_map: length: expected no negative numbers, got (-1.0, 0.0)",
        "load_map: file_path '../secret': expected a path below",
        "save_map: file_path '../new': expected a path below",
    ):
        assert reason in node.text


def test_server_starts_again_with_its_bag(other_side: Peer, tmp_path: Path) -> None:
    save_to_bag(map_of(1), tmp_path / "bag", "/map")
    options = arguments(directory=tmp_path, file_path=tmp_path / "bag", output_topic="/kept")
    other_side.listen("/kept", GridMapMessage)
    published = other_side.received["/kept"]
    for _ in range(2):
        published.clear()
        with running_node(MODULE, *options):
            assert_maps_equal(from_message(other_side.expect("/kept")), map_of(1))
            # For a while, discovery still lists the earlier server.
            with peer() as newcomer:
                ask(newcomer, "set_grid_map", map=to_message(map_of(2)))
            assert_maps_equal(from_message(other_side.expect("/kept", 2)), map_of(2))


@pytest.mark.needs("xarray", "zarr", "dask")
def test_parts_of_a_source_are_read_for_each_request(other_side: Peer, tmp_path: Path) -> None:
    whole = make_site(tmp_path / "site.zarr")
    options = arguments(source=tmp_path / "site.zarr", max_cells=50_000, directory=tmp_path)
    with running_node(MODULE, *options) as node:
        assert ask(other_side, "get_grid_map_info").info == to_message(whole).info
        where = {"position_x": 105.0, "position_y": -52.0, "length_x": 9.7, "length_y": 4.3}
        for frame_id, layers in (("", []), ("map", ["variance"]), ("", ["variance", "elevation"])):
            request = {"frame_id": frame_id, "layers": layers, **where}
            found = from_message(ask(other_side, "get_grid_map", **request).map)
            expected = whole.get_submap((105.0, -52.0), (9.7, 4.3))
            assert_maps_equal(found, from_message(to_message(expected, layers or None)))
        # Where the map ends, so does the part.
        corner = {"position_x": 120.0, "position_y": -62.6, "length_x": 3.0, "length_y": 2.0}
        found = from_message(ask(other_side, "get_grid_map", **corner).map)
        assert_maps_equal(found, whole.get_submap((120.0, -62.6), (3.0, 2.0)))

        assert not ask(other_side, "load_map", file_path="site.zarr").success
        ask(other_side, "set_grid_map", map=to_message(map_of(1)))
        damaged = tmp_path / "site.zarr" / "variance" / "0.0"
        damaged.write_bytes(bytes(100))
        requests: list[dict[str, Any]] = [
            {},
            {"frame_id": "odom", **where},
            {"layers": ["slope"], **where},
            {"position_x": 0.0, "length_x": 1.0, "length_y": 1.0},
            {"position_x": 120.0, "position_y": -37.5, "length_x": 1.0, "length_y": 1.0},
        ]
        for request in requests:
            assert ask(other_side, "get_grid_map", **request).map.info.resolution == 0.0
        assert not ask(other_side, "save_map", file_path="bag").success
        found = from_message(ask(other_side, "get_grid_map", **where).map)
        assert_maps_equal(found, whole.get_submap((105.0, -52.0), (9.7, 4.3)))
        topics = dict(other_side.node.get_topic_names_and_types())
        assert "/grid_map" not in topics
    for reason in (
        "set_grid_map: the map is fixed by the parameter 'source'",
        "get_grid_map: map: expected at most 50000 cells, got 401 x 253",
        "get_grid_map: frame_id: expected 'map', that of the map, got 'odom'",
        "get_grid_map: no layer 'slope'; available: elevation, variance",
        "does not overlap the map",
        "site.zarr/variance: cannot be read: error during blosc",
        "save_map: map: expected at most 50000 cells",
    ):
        assert reason in node.text, node.text
