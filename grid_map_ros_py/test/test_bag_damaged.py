# SPDX-License-Identifier: BSD-3-Clause
"""Damaged bags, and saves that fail or are killed: one clear error, and the old bag stays."""

import itertools
import re
import shutil
import sqlite3
import struct
import zlib
from contextlib import closing, suppress
from pathlib import Path

import pytest
from bags import DATA, SECOND, TOPIC, number_of, numbered_map, write_mcap

from grid_map_core_py import GridMap
from grid_map_core_py._commands import main
from grid_map_core_py.errors import GridMapError
from grid_map_ros_py import (
    BagError,
    BagReader,
    bag_maps,
    load_from_bag,
    save_to_bag,
    to_serialized_message,
)

pytestmark = pytest.mark.needs("mcap", "rosbags")


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "file"


# --- damaged files --------------------------------------------------------------------------------

FILES = {
    "mcap": DATA / "cpp_move_mcap" / "cpp_move_mcap_0.mcap",
    "zstd": DATA / "cpp_tutorial_outputs.mcap",
    "sqlite3": DATA / "cpp_move_sqlite" / "cpp_move_sqlite_0.db3",
}


@pytest.mark.parametrize("name", FILES)
def test_truncated_file_is_refused(name, path):
    data = FILES[name].read_bytes()
    cuts = [*range(1, 120, 17), *range(200, len(data), len(data) // 9), len(data) - 1]
    for cut in cuts:
        path.write_bytes(data[:cut])
        with pytest.raises(BagError, match=str(path)):
            list(bag_maps(path, TOPIC))


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"", "is empty"), (b"#ROSBAG V2.0\n" + bytes(99), "a bag of ROS 1; 'rosbags-convert'")],
)
def test_file_of_another_kind_is_refused(path, content, reason):
    path.write_bytes(content)
    with pytest.raises(BagError, match=reason):
        load_from_bag(path, TOPIC)


def record(code: int, content: bytes) -> bytes:
    return struct.pack("<BQ", code, len(content)) + content


@pytest.mark.parametrize(
    ("compression", "data", "size", "checksum", "reason"),
    [
        (b"lz4", b"", 2**40, 0, f"a chunk: expected at most 4000000000 bytes, got {2**40}"),
        (b"zstd", b"", 2**30, 0, "expected at most 1100 bytes from one byte, got 1073741824"),
        (b"zstd", b"abc", 10, 0, "cannot be read: .*"),
        (b"", b"", 2**40, 0, "a wrong chunk at 25"),
        (b"xz", b"", 0, 0, "its compression 'xz' is not known"),
        (b"", b"abc", 3, zlib.crc32(b"abd"), "wrong chunk at 25; recover=True .* 'mcap recover'"),
    ],
)
def test_damaged_chunk_is_refused(path, compression, data, size, checksum, reason):
    chunk = struct.pack("<QQQI", 0, 0, size, checksum)
    chunk += struct.pack("<I", len(compression)) + compression
    chunk += struct.pack("<Q", len(data)) + data
    records = [(1, bytes(8)), (6, chunk), (15, bytes(4)), (2, bytes(20))]
    magic = b"\x89MCAP0\r\n"
    path.write_bytes(magic + b"".join(record(*one) for one in records) + magic)
    with pytest.raises(GridMapError, match=f"{path}.*{reason}"):
        BagReader(path, TOPIC)


# --- recovery -------------------------------------------------------------------------------------

NUMBERS = [1, 2, 3, 4, 5, 6]
SIZE = len(to_serialized_message(numbered_map(1)))


def recovered(path: Path) -> list[int]:
    return [number_of(grid_map) for grid_map in bag_maps(path, TOPIC, recover=True)]


@pytest.mark.filterwarnings("ignore:.*read up to the last whole chunk")
@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_cut_off_file_gives_all_whole_chunks(tmp_path, compression):
    options = {"chunk_size": 2 * SIZE, "compression": compression}
    whole = write_mcap(tmp_path / "whole.mcap", NUMBERS, **options)
    data, path = whole.read_bytes(), tmp_path / "cut.mcap"
    counts = []
    for cut in [*range(60, len(data), 37), len(data) - 1]:
        path.write_bytes(data[:cut])
        found: list[int] = []
        with suppress(BagError):  # no topic so far
            found = recovered(path)
        assert found == NUMBERS[: len(found)]
        counts.append(len(found))
    assert counts == sorted(counts)
    assert counts[-1] == len(recovered(whole)) == 6


def test_folder_of_a_killed_recorder_is_read_on_request(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    write_mcap(folder / "bag_0.mcap", [1, 2])
    data = write_mcap(folder / "bag_1.mcap", [3, 4], use_chunking=False).read_bytes()
    end = data.index(to_serialized_message(numbered_map(4)))
    # Some file systems leave zeros.
    (folder / "bag_1.mcap").write_bytes(data[: end - 31] + bytes(99))
    (folder / "bag_2.mcap").touch()
    with pytest.raises(BagError, match=r"without metadata\.yaml; read bag_0.* recover=True"):
        load_from_bag(folder)
    with pytest.raises(
        BagError, match=r"is cut off.*recover=True.*'mcap recover' repairs the file"
    ):
        load_from_bag(folder / "bag_1.mcap")
    with pytest.warns(UserWarning, match="bag_1"):
        assert recovered(folder) == [1, 2, 3]


def test_convert_recovers_a_bag_and_leaves_out_damaged_maps(tmp_path, capfd):
    path = write_mcap(tmp_path / "a.mcap", NUMBERS, use_chunking=False)
    data = bytearray(path.read_bytes())
    # Message 2 is damaged, and message 5 cut off.
    place = data.index(to_serialized_message(numbered_map(2)))
    data[place + 12 : place + 16] = b"\xff\xff\xff\x7f"
    path.write_bytes(data[: data.index(to_serialized_message(numbered_map(5))) + 300])
    bag = str(tmp_path / "saved")
    assert main(["convert", str(path), bag]) == 1
    assert "recover=True (--recover)" in capfd.readouterr().err
    assert main(["convert", str(path), bag, "--recover"]) == 0
    error = capfd.readouterr().err
    assert re.search(r"warning: .*a\.mcap: is damaged and read up to", error)
    assert "left out: " in error
    assert "map 1 on /grid_map: header.frame_id: expected" in error
    assert "3 maps in " in error
    assert [one.time // SECOND for one in BagReader(bag)] == [1, 3, 4]


# --- databases and metadata -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("statement", "reason"),
    [
        ("DROP TABLE topics", "no such table: topics"),
        ("UPDATE messages SET data = 'text' WHERE id = 3", "cannot be read: "),
        ("UPDATE messages SET timestamp = 'now' WHERE id = 3", "cannot be read: "),
        ("ALTER TABLE messages DROP COLUMN data", "no such column: data"),
        ("UPDATE messages SET data = zeroblob(900) WHERE id = 3", "map 2 on /grid_map: "),
        ("UPDATE topics SET name = CAST(x'ff' AS TEXT)", "UTF-8"),
        ("DELETE FROM messages", "no map -1: 0 maps on /grid_map"),
    ],
)
def test_database_that_is_no_bag_is_refused(path, statement, reason):
    shutil.copy(FILES["sqlite3"], path)
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(statement)
    with pytest.raises(BagError, match=f"(?s){path}.*{reason}"):
        assert [*bag_maps(path, TOPIC)] == [load_from_bag(path, TOPIC)]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "'rosbag2_bagfile_information' is missing"),
        ("rosbag2_bagfile_information: 3", "is missing"),
        ("rosbag2_bagfile_information: {a: b}", "expected a list of names"),
        ("rosbag2_bagfile_information: {relative_file_paths: []}", "expected a list"),
        ("rosbag2_bagfile_information: {relative_file_paths: ['']}", "is missing"),
        ("{", "no valid YAML"),
    ],
    ids=range(6),
)
def test_damaged_metadata_is_refused(tmp_path, text, reason):
    bag = tmp_path / "bag"
    save_to_bag(numbered_map(1), bag, TOPIC)
    (bag / "metadata.yaml").write_text(text)
    with pytest.raises(GridMapError, match=rf"{bag}.*{reason}"):
        load_from_bag(bag)


# --- saves that fail ------------------------------------------------------------------------------


def test_error_of_caller_leaves_the_old_bag(tmp_path):
    save_to_bag(numbered_map(1), tmp_path / "bag", TOPIC)

    def maps():
        yield numbered_map(2)
        raise OSError("of the caller")

    with pytest.raises(OSError, match="of the caller"):
        save_to_bag(maps(), tmp_path / "bag", TOPIC)
    assert number_of(load_from_bag(tmp_path / "bag")) == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]


@pytest.mark.parametrize("limit", [0, 20_000])
@pytest.mark.parametrize("options", [{"storage": "sqlite3"}, {}, {"compression": "zstd"}])
def test_full_disk_is_one_error_and_leaves_old_bag(tmp_path, full_disk, limit, options):
    save_to_bag(numbered_map(1), tmp_path / "bag", TOPIC)
    # Chunks that compress well, so that some are still in the file's buffer when the disk is full.
    maps = itertools.repeat(GridMap((45, 45), 0.1, layers={"a": 1.0}))
    with (
        full_disk(limit),
        pytest.raises(BagError, match=r"bag: cannot be written: (File too large|disk I/O error)"),
    ):
        save_to_bag(maps, tmp_path / "bag", TOPIC, **options)
    assert number_of(load_from_bag(tmp_path / "bag")) == 1
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]
