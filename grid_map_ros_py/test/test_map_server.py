# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`MapServer` without a node."""

import os
from pathlib import Path

import numpy as np
import pytest
from test_grid_map import sample_map

from grid_map_core_py import GeometryError, LayerNotFoundError, OutOfMapError
from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py import from_message
from grid_map_ros_py._mapping.map_server import MapServer, path_inside
from grid_map_ros_py.bags import save_to_bag
from grid_map_ros_py.errors import BagError, RequestError


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """Directory for bags, beside a directory that requests must not reach."""
    for name in ("bags", "secret"):
        (tmp_path / name).mkdir()
    save_to_bag(sample_map(), tmp_path / "secret" / "bag", "/map")
    return tmp_path / "bags"


@pytest.fixture
def server(directory: Path) -> MapServer:
    """Return a server of 3 x 4 cells of 0.5 m around (1, -2), moved in its buffer."""
    server = MapServer(directory)
    server.grid_map = sample_map()
    return server


@pytest.mark.parametrize("frame_id", ["", "odom"])
def test_length_of_zero_asks_for_the_whole_map(server: MapServer, frame_id: str) -> None:
    message = server.part(frame_id, (50.0, 0.0), (0.0, 0.0))
    assert_maps_equal(from_message(message), sample_map())


def test_part_has_the_cells_that_overlap_the_rectangle(server: MapServer) -> None:
    part = from_message(server.part("odom", (1.0, -2.0), (0.9, 0.4)))
    assert_maps_equal(part, sample_map().get_submap((1.0, -2.0), (0.9, 0.4)))
    assert part.size == (3, 2)
    assert part.basic_layers == ("elevation",)


def test_part_ends_where_the_map_ends(server: MapServer) -> None:
    part = from_message(server.part("", (1.75, -1.0), (2.0, 1.0)))
    np.testing.assert_array_equal(part["elevation"], sample_map().unwrapped("elevation")[:2, :1])


def test_request_chooses_layers(server: MapServer) -> None:
    assert server.part("", (1, -2), (1, 1), ["variance"]).layers == ["variance"]


@pytest.mark.parametrize(
    ("frame_id", "position", "length", "layers", "error", "text"),
    [
        ("map", (0, 0), (1, 1), [], RequestError, r"frame_id: expected 'odom'.*, got 'map'"),
        ("", (50, 0), (1, 1), [], OutOfMapError, "does not overlap the map"),
        ("", (1, -2), (-1, 1), [], GeometryError, "negative"),
        ("", (float("nan"), 0), (1, 1), [], GeometryError, "finite"),
        ("", (1, -2), (float("inf"), 1), [], GeometryError, "finite"),
        ("", (0, 0), (0, 0), ["slope"], LayerNotFoundError, "'slope'; available: elevation"),
    ],
)
def test_invalid_request_is_refused(
    server, frame_id, position, length, layers, error, text
) -> None:
    with pytest.raises(error, match=text):
        server.part(frame_id, position, length, layers)


def test_info_equals_the_map(server: MapServer) -> None:
    info = server.info()
    assert (info.resolution, info.length_x, info.length_y) == (0.5, 1.5, 2.0)
    assert (info.pose.position.x, info.pose.position.y) == (1.0, -2.0)


def test_server_without_map_refuses_requests_for_it(directory: Path) -> None:
    server = MapServer(directory)
    for ask in (
        server.info,
        lambda: server.part("", (0, 0), (0, 0)),
        lambda: server.save("bag", "/map"),
    ):
        with pytest.raises(RequestError, match="there is no map yet"):
            ask()
    assert not [*directory.iterdir()]


def test_map_is_saved_and_loaded_again(server: MapServer, directory: Path) -> None:
    server.save("first", "/map")
    server.save(str(directory / "second"), "/other")
    for loaded in (server.load("first"), server.load("second", "/other")):
        assert_maps_equal(loaded, sample_map())
        assert loaded.start_index == sample_map().start_index
    with pytest.raises(BagError, match="/other"):
        server.load("second", "/map")
    with pytest.raises(BagError, match="third"):
        server.load("third")


# --- what is outside ----------------------------------------------------------------------------

OUTSIDE = [
    "",
    ".",
    "/",
    "..",
    "../secret/bag",
    "inner/../../secret/bag",
    "link/bag",
    "bag of links",
    "dangling",
    "loop",
    "/etc/passwd",
    "{secret}/bag",
    "{bags}",
    "{bags}/../secret/bag",
    "{bags}2/bag",
    "~/bag",
    "nul\0",
    "x" * 5000,
]


@pytest.mark.parametrize("path", OUTSIDE)
def test_paths_that_lead_outside_are_refused(server: MapServer, directory: Path, path: str) -> None:
    secret = directory.parent / "secret"
    (directory.parent / "bags2").mkdir()
    (directory / "inner").mkdir()
    (directory / "link").symlink_to(secret)
    (directory / "dangling").symlink_to(secret / "new")
    (directory / "loop").symlink_to("loop")
    (directory / "bag of links").mkdir()
    for file in (secret / "bag").iterdir():
        (directory / "bag of links" / file.name).symlink_to(file)
    path = path.format(secret=secret, bags=directory)
    before = sorted(directory.parent.rglob("*"))
    for attempt in (server.load, lambda path: server.save(path, "/map")):
        with pytest.raises((RequestError, BagError)) as error:
            attempt(path)
        assert path == "~/bag" or isinstance(error.value, RequestError)
    assert sorted(directory.parent.rglob("*")) == before


def test_links_that_stay_inside_are_followed(server: MapServer, directory: Path) -> None:
    server.save("bag", "/map")
    (directory / "latest").symlink_to("bag")
    assert_maps_equal(server.load("latest"), sample_map())


def test_directory_that_is_a_link_itself_is_fine(directory: Path) -> None:
    (directory.parent / "link").symlink_to(directory)
    assert path_inside(directory.parent / "link", "bag") == directory / "bag"


def test_without_a_directory_all_files_are_refused(tmp_path: Path) -> None:
    server = MapServer()
    server.grid_map = sample_map()
    os.chdir(tmp_path)
    for path in ("bag", str(tmp_path / "bag")):
        with pytest.raises(RequestError, match="the parameter 'directory' is not set"):
            server.save(path, "/map")
        with pytest.raises(RequestError, match="the parameter 'directory' is not set"):
            server.load(path)
