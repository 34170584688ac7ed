# SPDX-License-Identifier: BSD-3-Clause
"""Bags that were cut off or damaged are read on request, as far as they go."""

import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
import yaml
from bags import DATA, SECOND, TOPIC, number_of, numbered_map, write_mcap

from grid_map_core_py._commands import main
from grid_map_core_py.errors import GridMapError
from grid_map_ros_py import (
    BagError,
    BagReader,
    bag_maps,
    bag_topics,
    load_from_bag,
    to_serialized_message,
)

pytestmark = pytest.mark.needs("mcap")

NUMBERS = [1, 2, 3, 4, 5, 6]
PER_CHUNK = 2
SIZE = len(to_serialized_message(numbered_map(1)))

LAYOUTS = {
    "no chunks": {"use_chunking": False},
    "one chunk": {},
    "chunks": {"chunk_size": PER_CHUNK * SIZE},
    "lz4": {"chunk_size": PER_CHUNK * SIZE, "compression": "LZ4"},
    "zstd": {"chunk_size": PER_CHUNK * SIZE, "compression": "ZSTD"},
}


@pytest.fixture(params=LAYOUTS)
def layout(request, tmp_path) -> tuple[str, bytes]:
    """Name of a layout, and a file of maps 1 to 6."""
    options = {"compression": "NONE"} | LAYOUTS[request.param]
    return request.param, write_mcap(tmp_path / "whole.mcap", NUMBERS, **options).read_bytes()


def recovered(path: Path) -> list[int]:
    return [number_of(grid_map) for grid_map in bag_maps(path, TOPIC, recover=True)]


def test_cut_off_file_gives_all_maps_before_the_cut(layout, tmp_path):
    name, data = layout
    path = tmp_path / "cut.mcap"
    messages = [to_serialized_message(numbered_map(number)) for number in NUMBERS]
    end_of_data = data.rindex(messages[-1]) + SIZE if name in ("no chunks", "chunks") else len(data)
    found = []
    for cut in [*range(60, len(data), 37), len(data) - 1]:
        path.write_bytes(data[:cut])
        with suppress(BagError):  # no topic so far
            found = recovered(path)
        complete = [n for n, one in zip(NUMBERS, messages, strict=True) if one in data[:cut]]
        if name in ("lz4", "zstd"):
            assert found == NUMBERS[: len(found)]
        else:
            assert found == complete
        if found:
            with BagReader(path, recover=True) as reader:
                assert 0 <= reader.lost.size <= cut
                assert bool(reader.lost) == (reader.lost.size > 0)
                assert reader.lost.messages is None
            assert number_of(load_from_bag(path, recover=True)) == found[-1]
            assert [topic.count for topic in bag_topics(path, recover=True)] == [len(found)]
        if cut > end_of_data:
            assert found == NUMBERS
    assert found == NUMBERS


@pytest.mark.parametrize("name", ["cpp_move_mcap/cpp_move_mcap_0", "cpp_tutorial_outputs"])
def test_recording_of_cpp_is_recovered(name, tmp_path):
    data = (DATA / f"{name}.mcap").read_bytes()
    whole = [record.data for record in BagReader(DATA / f"{name}.mcap", TOPIC)]
    path = tmp_path / "cut.mcap"
    for share in (0.3, 0.6, 0.999):
        path.write_bytes(data[: int(share * len(data))])
        try:
            with BagReader(path, TOPIC, recover=True) as reader:
                assert [record.data for record in reader] == whole[: len(reader)]
                # The end of the file is an index.
                assert reader.lost or len(reader) == len(whole)
        except BagError:
            assert share < 0.5
    path.write_bytes(data)
    with BagReader(path, TOPIC, recover=True) as reader:
        assert [record.data for record in reader] == whole
        assert not reader.lost


def test_damaged_chunk_is_left_out_and_its_bytes_are_counted(tmp_path):
    options = {"chunk_size": PER_CHUNK * SIZE, "compression": "NONE"}
    path = write_mcap(tmp_path / "a.mcap", NUMBERS, **options)
    data = bytearray(path.read_bytes())
    third = to_serialized_message(numbered_map(3))
    data[data.index(third) + 200] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(BagError, match="checksum of a chunk is wrong"):
        list(bag_maps(path))
    numbers = recovered(path)
    assert 3 not in numbers
    assert {1, 6} <= {*numbers}
    with BagReader(path, recover=True) as reader:
        assert reader.lost.size >= SIZE
        assert str(reader.lost) == f"lost: {reader.lost.size} bytes cannot be read"


def test_zeros_at_the_end_are_no_records(tmp_path):
    path = write_mcap(tmp_path / "a.mcap", NUMBERS, use_chunking=False)
    data = path.read_bytes()
    end = data.index(to_serialized_message(numbered_map(4))) + SIZE
    path.write_bytes(data[:end] + bytes(1000))
    assert recovered(path) == [1, 2, 3, 4]


# --- bags of killed recorders ---------------------------------------------------------------------

RECORD_AND_DIE = """
import os, signal, sys
sys.path.insert(0, sys.argv[1])
from bags import SECOND, TOPIC, numbered_map
from grid_map_ros_py import to_serialized_message
from mcap.writer import Writer
os.mkdir(sys.argv[2])
for part, numbers in enumerate(((1, 2), (3, 4, 5))):
    file = open(f"{sys.argv[2]}/bag_{part}.mcap", "wb")
    writer = Writer(file, chunk_size=5000)
    writer.start("ros2", "test")
    schema = writer.register_schema("grid_map_msgs/msg/GridMap", "ros2msg", b"")
    channel = writer.register_channel(TOPIC, "cdr", schema)
    for number in numbers:
        data = to_serialized_message(numbered_map(number, side=20))
        writer.add_message(channel, number * SECOND, data, number * SECOND)
    if part == 0:
        writer.finish()
file.flush()
open(f"{sys.argv[2]}/bag_2.mcap", "wb")
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def killed(tmp_path) -> Path:
    """Folder of a recorder of 5 maps in two files that was killed; it has no metadata."""
    arguments = [str(Path(__file__).parent), str(tmp_path / "bag")]
    done = subprocess.run([sys.executable, "-c", RECORD_AND_DIE, *arguments])
    assert done.returncode == -signal.SIGKILL
    return tmp_path / "bag"


def test_bag_of_killed_recorder_is_read_on_request(killed):
    with pytest.raises(BagError, match=r"without metadata\.yaml; read bag_0.* recover=True"):
        load_from_bag(killed)
    with pytest.raises(
        BagError, match=r"is cut off.*recover=True.*bag reindex.*bag convert.*mcap recover"
    ):
        load_from_bag(killed / "bag_1.mcap")
    numbers = recovered(killed)
    assert numbers[:3] == [1, 2, 3]
    assert numbers == [1, 2, 3, 4, 5][: len(numbers)]


def reindex(bag: Path, count: int) -> None:
    """Write the metadata that `ros2 bag reindex` writes, which leaves the files as they are."""
    information = {
        "version": 9,
        "message_count": count,
        "relative_file_paths": ["bag_0.mcap", "bag_1.mcap"],
    }
    text = yaml.safe_dump({"rosbag2_bagfile_information": information})
    (bag / "metadata.yaml").write_text(text)


def test_reindexed_bag_is_read_without_a_request(killed):
    numbers = recovered(killed)
    reindex(killed, len(numbers))
    assert [number_of(grid_map) for grid_map in bag_maps(killed)] == numbers
    assert [topic.count for topic in bag_topics(killed)] == [len(numbers)]
    # An incomplete copy has fewer messages than its metadata says.
    reindex(killed, len(numbers) + 2)
    with pytest.raises(BagError, match=r"bag_1\.mcap: is cut off"):
        load_from_bag(killed)
    with BagReader(killed, recover=True) as reader:
        assert reader.lost.messages == 2
        assert str(reader.lost).startswith("lost: 2 messages, ")


# --- command line ---------------------------------------------------------------------------------


def test_convert_recovers_a_bag_and_counts_what_is_lost(tmp_path, capfd):
    path = write_mcap(tmp_path / "a.mcap", NUMBERS, use_chunking=False)
    data = bytearray(path.read_bytes())
    # Message 2 is damaged, and message 5 cut off.
    place = data.index(to_serialized_message(numbered_map(2)))
    data[place + 12 : place + 16] = b"\xff\xff\xff\x7f"
    path.write_bytes(data[: data.index(to_serialized_message(numbered_map(5))) + 300])
    bag = str(tmp_path / "saved")
    assert main(["convert", str(path), bag]) == 1
    assert "'grid-map convert --recover'" in capfd.readouterr().err
    assert main(["convert", str(path), bag, "--recover"]) == 0
    error = capfd.readouterr().err
    assert "a.mcap: lost: 331 bytes cannot be read" in error
    assert "left out: " in error
    assert "map 1 on /grid_map: header.frame_id: expected" in error
    assert "3 maps in " in error
    assert [record.time // SECOND for record in BagReader(bag)] == [1, 3, 4]
    assert main(["info", str(path), "--recover"]) == 0
    assert main(["convert", str(path), str(tmp_path / "last.npz"), "--recover"]) == 0


def test_recover_is_for_bags(tmp_path, capfd):
    (tmp_path / "a.npz").touch()
    with pytest.raises(SystemExit):
        main(["convert", str(tmp_path / "a.npz"), str(tmp_path / "b"), "--recover"])
    assert "--recover is for bag, and this is npz" in capfd.readouterr().err


def test_noise_is_refused_also_on_request(tmp_path):
    path = tmp_path / "a.mcap"
    for noise in (b"", b"\0" * 99, bytes(range(256))):
        path.write_bytes(b"\x89MCAP0\r\n" + noise)
        with pytest.raises(GridMapError, match="topics"):
            load_from_bag(path, recover=True)
