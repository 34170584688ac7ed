# SPDX-License-Identifier: BSD-3-Clause
"""Requests to the server of maps, without a node."""

from pathlib import Path
from typing import Any

import pytest
from test_grid_map import sample_map

from grid_map_core_py import GeometryError, GridMap, OutOfMapError
from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py import load_from_bag, save_to_bag
from grid_map_ros_py._serving import part, place_below
from grid_map_ros_py.errors import RequestError

# The sample has 3 x 4 cells of 0.5 m around (1, -2) in the frame odom, moved in its buffer.


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


def save(directory: Path | str, path: str, **options: str) -> None:
    with place_below(str(directory), path) as place:
        save_to_bag(sample_map(), place, "/map", **options)


def load(directory: Path | str, path: str) -> GridMap:
    with place_below(str(directory), path) as place:
        return load_from_bag(place, unwrap=False)


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """Directory for bags, beside a directory that requests must not reach."""
    (tmp_path / "bags" / "inner").mkdir(parents=True)
    (tmp_path / "secret").mkdir()
    save_to_bag(sample_map(), tmp_path / "secret" / "bag", "/map")
    return tmp_path / "bags"


OUTSIDE = [
    "",
    ".",
    "/",
    "..",
    "../secret/bag",
    "inner/../../secret/bag",
    "link/bag",
    "link",
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


@pytest.mark.parametrize("use", [save, load])
@pytest.mark.parametrize("path", OUTSIDE)
def test_paths_that_lead_outside_are_refused(directory: Path, path: str, use: Any) -> None:
    secret = directory.parent / "secret"
    before = contents(secret)
    (directory / "link").symlink_to(secret)
    (directory / "dangling").symlink_to(secret / "new")
    (directory / "loop").symlink_to("loop")
    with pytest.raises(RequestError, match="file_path"):
        use(directory, path.format(secret=secret, bags=directory))
    assert contents(secret) == before


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("path", ["bag", "inner/bag", "./bag", "{bags}/bag", "{link}/inner/bag"])
def test_bags_below_the_directory_round_trip(directory: Path, storage: str, path: str) -> None:
    link = directory.parent / "link"
    link.symlink_to(directory)
    path = path.format(bags=directory, link=link)
    for _ in range(2):
        save(link, path, storage=storage)
        assert_maps_equal(load(link, path), sample_map())
    (file,) = (file for file in (link / path).iterdir() if file.suffix in (".mcap", ".db3"))
    assert_maps_equal(load(link, f"{path}/{file.name}"), sample_map())
    assert not [*directory.rglob(".*")]


def test_errors_of_bags_name_the_path_of_the_request(directory: Path) -> None:
    (directory / "text").write_text("precious")
    for use, path, text in (
        (load, "missing", "'missing': no such file or folder"),
        (load, "text", "'text': .*"),
        (save, "text", "'text': is a file, and a bag is a folder"),
        (save, "red\x1b[31m", r"'red\\x1b\[31m': expected no control characters"),
    ):
        with pytest.raises(RequestError, match=f"^file_path {text}$") as error:
            use(directory, path)
        assert "/tmp" not in str(error.value)


@pytest.mark.parametrize("path", ["bag", "/tmp/bag"])
def test_without_a_directory_all_files_are_refused(path: str) -> None:
    with pytest.raises(RequestError, match="the parameter 'directory' is not set"):
        load("", path)
