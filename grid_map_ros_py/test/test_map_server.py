# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Requests to the server of maps, without a node."""

from pathlib import Path

import numpy as np
import pytest
from test_grid_map import sample_map

from grid_map_core_py import GeometryError, OutOfMapError
from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py._mapping.map_server import part, path_inside
from grid_map_ros_py.errors import RequestError

# The sample has 3 x 4 cells of 0.5 m around (1, -2) in the frame odom, moved in its buffer.


@pytest.mark.parametrize("frame_id", ["", "odom"])
def test_length_of_zero_asks_for_the_whole_map(frame_id: str) -> None:
    assert_maps_equal(part(sample_map(), frame_id, (50.0, 0.0), (0.0, 0.0)), sample_map())


def test_part_has_the_cells_that_overlap_the_rectangle() -> None:
    found = part(sample_map(), "odom", (1.0, -2.0), (0.9, 0.4))
    assert_maps_equal(found, sample_map().get_submap((1.0, -2.0), (0.9, 0.4)))
    assert found.size == (3, 2)
    assert found.basic_layers == ("elevation",)


def test_part_ends_where_the_map_ends() -> None:
    found = part(sample_map(), "", (1.75, -1.0), (2.0, 1.0)).unwrapped("elevation")
    np.testing.assert_array_equal(found, sample_map().unwrapped("elevation")[:2, :1])


@pytest.mark.parametrize(
    ("frame_id", "position", "length", "error", "text"),
    [
        ("map", (0, 0), (1, 1), RequestError, r"frame_id: expected 'odom'.*, got 'map'"),
        ("", (50, 0), (1, 1), OutOfMapError, "does not overlap the map"),
        ("", (1, -2), (-1, 1), GeometryError, "negative"),
        ("", (float("nan"), 0), (1, 1), GeometryError, "finite"),
        ("", (1, -2), (float("inf"), 1), GeometryError, "finite"),
    ],
)
def test_invalid_request_is_refused(frame_id, position, length, error, text) -> None:
    with pytest.raises(error, match=text):
        part(sample_map(), frame_id, position, length)


# --- paths ----------------------------------------------------------------------------------------


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """Directory for bags, beside a directory that requests must not reach."""
    (tmp_path / "bags").mkdir()
    (tmp_path / "secret" / "bag").mkdir(parents=True)
    (tmp_path / "secret" / "bag" / "metadata.yaml").touch()
    return tmp_path / "bags"


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
    "nul\0",
    "x" * 5000,
]


@pytest.mark.parametrize("path", OUTSIDE)
def test_paths_that_lead_outside_are_refused(directory: Path, path: str) -> None:
    secret = directory.parent / "secret"
    (directory / "inner").mkdir()
    (directory / "link").symlink_to(secret)
    (directory / "dangling").symlink_to(secret / "new")
    (directory / "loop").symlink_to("loop")
    (directory / "bag of links").mkdir()
    for file in (secret / "bag").iterdir():
        (directory / "bag of links" / file.name).symlink_to(file)
    with pytest.raises(RequestError, match="file_path"):
        path_inside(directory, path.format(secret=secret, bags=directory))


def test_links_and_tildes_that_stay_inside_are_followed(directory: Path) -> None:
    (directory / "latest").symlink_to("bag")
    assert path_inside(directory, "latest") == directory / "bag"
    assert path_inside(directory, str(directory / "bag")) == directory / "bag"
    assert path_inside(directory, "~/bag") == directory / "~" / "bag"
    (directory.parent / "link").symlink_to(directory)
    assert path_inside(directory.parent / "link", "bag") == directory / "bag"


@pytest.mark.parametrize("path", ["bag", "/tmp/bag"])
def test_without_a_directory_all_files_are_refused(path: str) -> None:
    with pytest.raises(RequestError, match="the parameter 'directory' is not set"):
        path_inside(None, path)
