# SPDX-License-Identifier: BSD-3-Clause
"""Bags without the package `mcap`: through `rosbag2_py`, and without both."""

import shutil
from importlib import import_module

import pytest
from bags import DATA, TOPIC, number_of, numbered_map, write_mcap

from grid_map_core_py import MissingPackageError, load
from grid_map_core_py.testing import assert_maps_equal
from grid_map_ros_py import (
    BagError,
    BagReader,
    BagWriter,
    bag_maps,
    bag_topics,
    load_from_bag,
    save_to_bag,
)
from grid_map_ros_py.bags._storage import Topic, dump, qos_profile

pytestmark = pytest.mark.needs("mcap", "rosbags")

MISSING = "needs the package 'mcap', which is not installed: .*pip install mcap"


# --- with rosbag2_py ------------------------------------------------------------------------------


@pytest.mark.usefixtures("rosbag2_py")
@pytest.mark.parametrize("in_place", [False, True])
def test_bags_of_rosbag2_py_round_trip(tmp_path, in_place):
    bag = tmp_path / "bag"
    moved = numbered_map(2)
    moved.move((0.2, -0.1))
    with BagWriter(bag, in_place=in_place) as writer:
        for time, grid_map in ((3, numbered_map(3)), (1, numbered_map(1)), (1, moved)):
            writer.write(TOPIC, grid_map, time=time)
        writer.write("/other", numbered_map(4), time=1)
    assert sorted(path.name for path in bag.iterdir()) == ["bag_0.mcap", "metadata.yaml"]
    assert [(one.name, one.count, one.first, one.last) for one in bag_topics(bag)] == [
        (TOPIC, 3, 1, 3),
        ("/other", 1, 1, 1),
    ]
    with BagReader(bag, TOPIC) as reader:
        assert [one.time for one in reader] == [1, 1, 3]
        assert number_of(reader[0].grid_map()) == 1
        restored = reader[1].grid_map(unwrap=False)
    assert_maps_equal(restored, moved)
    assert restored.start_index == moved.start_index != (0, 0)
    assert_maps_equal(load_from_bag(bag, TOPIC, time=2, unwrap=False), moved)
    assert number_of(load_from_bag(bag, "/other")) == 4


def test_files_of_rosbag2_py_are_read_with_mcap(tmp_path, request):
    definition = Topic(
        "std_msgs/msg/String", "cdr", dump([qos_profile(reliable=False, latched=False)])
    )
    request.getfixturevalue("rosbag2_py")
    with BagWriter(tmp_path / "bag") as writer:
        writer.write(TOPIC, numbered_map(1))
        writer.write_serialized("/text", definition, 5, b"text")
    request.getfixturevalue("monkeypatch").undo()
    assert number_of(load_from_bag(tmp_path / "bag", TOPIC)) == 1
    make_reader = import_module("mcap.reader").make_reader
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    found = {channel.topic: channel.metadata["offered_qos_profiles"] for channel in channels}
    assert "durability: transient_local" in found[TOPIC]
    assert "reliability: reliable" in found[TOPIC]
    assert "durability: volatile" in found["/text"]
    assert "reliability: best_effort" in found["/text"]


def test_rosbag2_py_reads_the_same_maps_as_mcap(tmp_path, request):
    bags = [DATA / "cpp_move_mcap", write_mcap(tmp_path / "x.mcap", [2, 1, 1], compression="LZ4")]
    expected = [list(bag_maps(bag, TOPIC)) for bag in bags]
    request.getfixturevalue("rosbag2_py")
    for bag, maps in zip(bags, expected, strict=True):
        found = list(bag_maps(bag, TOPIC))
        assert len(found) == len(maps) > 1
        for one, other in zip(found, maps, strict=True):
            assert_maps_equal(one, other)


@pytest.mark.usefixtures("rosbag2_py")
def test_rosbag2_py_cannot_recover_or_compress_with_lz4(tmp_path):
    bag = tmp_path / "bag"
    save_to_bag(numbered_map(1), bag, TOPIC, compression="zstd")
    with pytest.raises(MissingPackageError, match=f"^compression 'lz4' {MISSING}"):
        save_to_bag(numbered_map(2), bag, TOPIC, compression="lz4")
    with pytest.raises(
        MissingPackageError, match=f"^recovery of the bag {bag}/bag_0.mcap {MISSING}"
    ):
        load_from_bag(bag, recover=True)
    assert number_of(load_from_bag(bag)) == 1


@pytest.mark.usefixtures("rosbag2_py")
def test_unterminated_file_of_rosbag2_py_does_not_replace_a_bag(tmp_path, monkeypatch):
    rosbag2_py = import_module("rosbag2_py")
    bag = tmp_path / "bag"
    save_to_bag(numbered_map(1), bag, TOPIC)
    close = rosbag2_py.SequentialWriter.close

    def close_on_a_full_disk(writer):
        close(writer)
        data = writer._right.read_bytes()
        writer._right.write_bytes(data[: len(data) // 2])

    monkeypatch.setattr(rosbag2_py.SequentialWriter, "close", close_on_a_full_disk)
    with pytest.raises(BagError, match=f"^{bag}: cannot be written"):
        save_to_bag(numbered_map(2), bag, TOPIC)
    assert number_of(load_from_bag(bag)) == 1
    assert list(tmp_path.iterdir()) == [bag]


# --- without both ---------------------------------------------------------------------------------


@pytest.mark.usefixtures("no_mcap")
def test_bags_become_sqlite3_with_a_warning(tmp_path):
    bag = tmp_path / "bag"
    with pytest.warns(UserWarning, match="^bags are saved as sqlite3: .*'mcap'.*pip install mcap"):
        save_to_bag(numbered_map(1), bag, TOPIC)
    assert (bag / "bag_0.db3").exists()
    assert number_of(load(bag)) == 1
    save_to_bag(numbered_map(2), bag, TOPIC, storage="sqlite3")  # without a warning
    assert number_of(load(bag)) == 2
    with (
        pytest.warns(UserWarning, match="^bags are saved as sqlite3"),
        pytest.raises(MissingPackageError, match=f"^compression 'zstd' {MISSING}"),
    ):
        save_to_bag(numbered_map(3), bag, TOPIC, compression="zstd")
    assert number_of(load(bag)) == 2


@pytest.mark.usefixtures("no_mcap")
@pytest.mark.filterwarnings("ignore:bags are saved as sqlite3")
def test_killed_sqlite3_recording_keeps_its_messages(tmp_path):
    with BagWriter(tmp_path / "bag", in_place=True) as writer:
        for number in (1, 2):
            writer.write(TOPIC, numbered_map(number))
        shutil.copytree(tmp_path / "bag", tmp_path / "killed")
    killed, whole = bag_maps(tmp_path / "killed", recover=True), bag_maps(tmp_path / "bag")
    assert [number_of(one) for one in killed] == [number_of(one) for one in whole] == [1, 2]
    assert {path.name for path in (tmp_path / "bag").iterdir()} == {"bag_0.db3", "metadata.yaml"}


def test_mcap_bags_without_packages_raise_errors(tmp_path, request):
    bag = tmp_path / "bag"
    save_to_bag(numbered_map(1), bag, TOPIC)
    request.getfixturevalue("no_mcap")
    with pytest.raises(MissingPackageError, match=f"^the bag {bag} {MISSING}"):
        save_to_bag(numbered_map(2), bag, TOPIC, storage="mcap")
    with pytest.raises(MissingPackageError, match=f"^the bag {bag}/bag_0.mcap {MISSING}"):
        load_from_bag(bag)
