# SPDX-License-Identifier: BSD-3-Clause
"""Bags and octomaps in the table of formats and on the command line `grid-map`."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
from octomap_stand_in import write_binary

from grid_map_core_py import GridMap, GridMapError, LayerNotFoundError, load, save
from grid_map_core_py.files import save_npz
from grid_map_core_py.testing import assert_maps_equal, moved_in_buffer
from grid_map_ros_py import BagReader, BagWriter, bag_maps

SECOND = 1_000_000_000


def a_map(second: int = 3) -> GridMap:
    """Return a moved map with a hole."""
    options = {"position": (1.0, 2.0), "frame_id": "odom", "timestamp": second * SECOND}
    made = GridMap((0.8, 0.6), 0.1, layers={"elevation": second, "variance": 0.25}, **options)
    made["elevation"][2, 3:5] = np.nan
    return moved_in_buffer(made, (3, 1))


@pytest.fixture
def command(grid_map_command):
    """Return `grid_map_command` in a folder with bags."""
    with BagWriter("survey") as bag:
        for second in (1, 2, 3):
            bag.write("/grid_map", a_map(second), time=second * SECOND + 7)
    with BagWriter("two") as bag:
        bag.write("/one", a_map(1))
        bag.write("/other", a_map(2))
        bag.write("/other", a_map(3))
    save_npz(a_map(), "site.npz")

    return grid_map_command


@pytest.mark.usefixtures("command")
def test_bags_are_loaded_and_saved_by_name():
    expected = a_map()
    expected.convert_to_default_start_index()
    assert_maps_equal(load("survey"), expected)
    assert_maps_equal(
        load(Path("survey/survey_0.mcap"), layers=["variance"]).copy(),
        expected.without_layers(["elevation"]),
    )
    assert load("two", topic="/other", index=0).timestamp == 2 * SECOND
    save(a_map(1), "new", topic="/site", compress=True)
    with BagReader("new") as bag:
        assert (bag.topic, len(bag)) == ("/site", 1)
    save(a_map(1), "lite", storage="sqlite3")
    assert load("lite/lite_0.db3").timestamp == SECOND


def test_info_prints_topics_and_one_map_of_each(command):
    code, text, _ = command("info two --json")
    assert code == 0
    one, other = json.loads(text)["topics"]
    assert one.pop("map")["timestamp"] == SECOND
    assert other.pop("map")["start_index"] == [3, 1]
    kind = "grid_map_msgs/msg/GridMap"
    assert one == {"name": "/one", "type": kind, "count": 1, "first": SECOND, "last": SECOND}
    assert (other["count"], other["first"], other["last"]) == (2, 2 * SECOND, 3 * SECOND)
    _, text, _ = command("info two --topic /other --index 0")
    assert "/one" not in text
    assert "map 0" in text
    assert "2.000000000 s" in text


def test_info_prints_duration_and_millimeters(command):
    far = GridMap((4, 3), 0.5, (691_002.25, 5_334_798.625), ["elevation"])
    with BagWriter("far") as bag:
        for second in (1_700_000_000.0, 1_700_000_002.5):
            bag.write("/grid_map", far, time=int(second * SECOND))
    head, *rows = command("info far")[1].splitlines()
    assert head.startswith("far: bag, ")
    assert head.endswith(", 2.5 s from 2023-11-14 22:13:20 UTC")
    assert "position  (691002.25, 5334798.625)" in rows


def test_convert_keeps_all_maps_times_and_start_indices(command):
    words = "--layer elevation --compress --frame site --output-topic /site"
    code, text, error = command(f"convert survey copy {words}")
    assert (code, text) == (0, ""), error
    assert "3/3 maps" in error
    assert error.endswith("grid-map: 3 maps in copy\n")
    with BagReader("copy", "/site") as bag:
        assert [record.time for record in bag] == [n * SECOND + 7 for n in (1, 2, 3)]
        for second, record in enumerate(bag, 1):
            actual = record.grid_map(unwrap=False)
            assert (actual.layers, actual.frame_id) == (("elevation",), "site")
            assert actual.start_index == (3, 1)
            np.testing.assert_array_equal(actual["elevation"], a_map(second)["elevation"])


def test_convert_writes_bags_of_both_storages(command):
    assert command("convert survey lite --storage sqlite3")[0] == 0
    assert command("convert lite/lite_0.db3 again --storage mcap")[0] == 0
    for path in ("lite/lite_0.db3", "again/again_0.mcap"):
        with BagReader(path) as bag, BagReader("survey") as source:
            assert [record[:2] for record in bag] == [record[:2] for record in source]
    code, _, error = command("convert survey small --storage sqlite3 --compress")
    assert (code, error.count("Traceback")) == (1, 0)
    assert error.endswith("small: compression of sqlite3: expected 'none', got 'zstd'\n")


def test_one_map_is_the_last_or_the_chosen_one(command):
    for line in (
        "survey last.npz",
        "survey first.npz --index 0",
        "survey second --index 1",
    ):
        assert command(f"convert {line}")[0] == 0
    assert load("last.npz").timestamp == 3 * SECOND
    assert load("first.npz").timestamp == SECOND
    assert [one.timestamp for one in bag_maps("second", "/grid_map")] == [2 * SECOND]


@pytest.mark.parametrize(
    ("line", "code", "text"),
    [
        ("info two --topic /none", 1, "no topic '/none'; topics: /one"),
        ("inspect two", 1, "2 topics of maps, name one"),
        ("inspect site.npz --index 1", 2, "--index is for bag, and this is npz"),
        ("convert site.npz survey", 1, "survey: already exists; --force replaces it"),
        ("convert survey survey --force", 1, "is also the source"),
        ("convert site.npz map.mcap", 2, "a bag is a folder; its name has no ending: map"),
        ("convert site.npz copy --recover", 2, "--recover is for bag, and this is npz"),
        ("info .", 1, "not a bag: a folder without metadata.yaml"),
    ],
)
def test_mistakes_are_one_line(line, code, text, refused):
    found, error = refused(line)
    assert (found, text in error) == (code, True), error


# --- octomaps -------------------------------------------------------------------------------------

FREE_AND_OCCUPIED = struct.pack("<H", 0b10_01)
"""A tree of two leaves below the root."""


@pytest.mark.parametrize("comment", [b"", b"# a comment\n", b"# size 1\n"])
def test_octomap_files_may_hold_comments(comment, tmp_path):
    head = b"# Octomap OcTree binary file\n" + comment + b"id OcTree\nsize 3\nres 8192\ndata\n"
    (tmp_path / "tree.bt").write_bytes(head + FREE_AND_OCCUPIED)
    options = {"min_bound": (-8192 * 2, -8192, -1e9), "max_bound": (8192 * 2, 0, 1e9)}
    grid_map = load(tmp_path / "tree.bt", height_layer="top", frame_id="odom", **options)
    assert (grid_map.layers, grid_map.frame_id, grid_map.resolution) == (("top",), "odom", 8192.0)
    with pytest.raises(LayerNotFoundError, match="'elevation'; available: top"):
        load(tmp_path / "tree.bt", layers=["elevation"], height_layer="top")


def test_full_octomap_files_are_loaded(tmp_path):
    # A root whose only child, number 7, is a leaf.
    tree = struct.pack("<fBfB", 0.5, 0b1000_0000, 0.5, 0)
    head = b"# Octomap OcTree file\nid OcTree\nsize 2\nres 1e-4\ndata\n"
    (tmp_path / "tree.ot").write_bytes(head + tree)
    bounds = {"min_bound": (0.0, 0.0, 0.0), "max_bound": (2e-4, 1e-4, 1e-3)}
    np.testing.assert_allclose(load(tmp_path / "tree.ot", **bounds)["elevation"], [[9.5e-4]] * 2)


FAR = write_binary({(0,) * 16: True, (7,) * 16: True})
"""Octree with a voxel at each end, 65,536 voxels apart."""


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (None, "cannot be read: No such file"),
        (b"", "expected a .bt or .ot file"),
        (b"# Octomap OcTree binary file\nid OcTree\ndata\n", "lacks 'id' or 'res'"),
        (b"# Octomap OcTree binary file\nid OcTree\nres many\ndata\n", "could not convert"),
        (b"# Octomap OcTree binary file\nid OcTree\nres 0.1\ndata\n\x01", "data"),
        (b"# Octomap OcTree binary file\nid OcTree\nres 0.1\ndata\n" + FAR, "at most .* cells"),
    ],
)
def test_files_that_are_no_octomap_are_named(content, found, tmp_path):
    file = tmp_path / "tree.bt"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(GridMapError, match=rf"{file}: .*{found}"):
        load(file)
