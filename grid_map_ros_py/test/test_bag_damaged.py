# SPDX-License-Identifier: BSD-3-Clause
"""Damaged, truncated and malicious bags raise one clear error and take little memory."""

import shutil
import sqlite3
import struct
import tracemalloc
import zlib
from contextlib import closing
from pathlib import Path

import pytest
import yaml
from bags import DATA, RECORDED_MOVES, TOPIC, number_of, numbered_map, write_mcap
from hypothesis import HealthCheck, given, settings, strategies as st

from grid_map_core_py.errors import GridMapError, LimitError
from grid_map_core_py.limits import changed_limits
from grid_map_ros_py import BagError, BagReader, bag_maps, load_from_bag, save_to_bag

pytestmark = pytest.mark.needs("mcap", "rosbags")


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / "file"


def read_all(path: Path) -> int:
    return sum(1 for _ in bag_maps(path, TOPIC))


# --- any damage -----------------------------------------------------------------------------------

FILES = {
    "mcap": DATA / "cpp_move_mcap" / "cpp_move_mcap_0.mcap",
    "zstd": DATA / "cpp_tutorial_outputs.mcap",
    "sqlite3": DATA / "cpp_move_sqlite" / "cpp_move_sqlite_0.db3",
}


@pytest.mark.parametrize("name", FILES)
def test_truncated_file_is_refused(name, path):
    data = FILES[name].read_bytes()
    cuts = [*range(1, 120, 7), *range(200, len(data), len(data) // 40), len(data) - 1]
    for cut in cuts:
        path.write_bytes(data[:cut])
        with pytest.raises(BagError, match=str(path)):
            read_all(path)


@given(st.binary(max_size=300), st.sampled_from([b"\x89MCAP0\r\n", b"SQLite format 3\0", b""]))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_noise_is_refused(path, noise, magic):
    path.write_bytes(magic + noise)
    with pytest.raises(BagError, match=str(path)):
        read_all(path)


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"", "is empty"), (b"#ROSBAG V2.0\n" + bytes(99), "a bag of ROS 1; 'rosbags-convert'")],
)
def test_file_of_another_kind_is_refused(path, content, reason):
    path.write_bytes(content)
    with pytest.raises(BagError, match=reason):
        load_from_bag(path, TOPIC)


# --- wrong lengths --------------------------------------------------------------------------------


def record(code: int, content: bytes) -> bytes:
    return struct.pack("<BQ", code, len(content)) + content


def with_chunk(
    path: Path, compression: bytes, data: bytes, size: int, checksum: int = 0, count: int = 1
) -> Path:
    """Write a file with `count` equal chunks, each declaring a content of `size` bytes."""
    chunk = struct.pack("<QQQI", 0, 0, size, checksum)
    chunk += struct.pack("<I", len(compression)) + compression
    chunk += struct.pack("<Q", len(data)) + data
    records = [(1, bytes(8)), *[(6, chunk)] * count, (15, bytes(4)), (2, bytes(20))]
    body = b"".join(record(*one) for one in records)
    magic = b"\x89MCAP0\r\n"
    path.write_bytes(magic + body + magic)
    return path


def assert_refused_without_memory(path: Path, reason: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(GridMapError, match=reason):
            BagReader(path, TOPIC)
        assert tracemalloc.get_traced_memory()[1] < 20e6
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("chunk", "reason"),
    [
        *(
            ((b"lz4", b"", size), f"a chunk: expected at most 4000000000 bytes, got {size}")
            for size in (2**40, 2**64 - 1)
        ),
        ((b"zstd", b"", 2**30), "expected at most 1100 bytes from one byte, got 1073741824"),
        ((b"", b"", 2**40), f"a chunk of {2**40} bytes holds 0"),
        ((b"xz", b"", 0), "its compression 'xz' is not known"),
        ((b"", b"abc", 3, zlib.crc32(b"abd")), "checksum of a chunk is wrong"),
    ],
)
def test_invalid_chunk_is_refused_without_taking_memory(path, chunk, reason):
    assert_refused_without_memory(with_chunk(path, *chunk), reason)


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_decompression_stops_at_the_claimed_size(path, compression):
    packages = {"lz4": "lz4.frame", "zstd": "zstandard"}
    package = pytest.importorskip(packages[compression])
    packed = package.compress(bytes(1000))
    with_chunk(path, compression.encode(), packed, 100_000_000)
    assert_refused_without_memory(path, "chunk of 100000000 bytes holds 1000")
    # 100 MB of zeros in a chunk that declares 1000 MB.
    packed = package.compress(bytes(100_000_000))
    with_chunk(path, compression.encode(), packed, 1000)
    assert_refused_without_memory(path, "chunk of 1000 bytes holds 1001")


@pytest.mark.parametrize("recover", [False, True])
@pytest.mark.parametrize(
    ("content", "name"),
    [
        (record(99, bytes(20_000_000)), "its chunks"),
        (record(5, bytes(22)) * 50_000, "the list of its messages"),
    ],
    ids=["bytes", "messages"],
)
def test_limits_hold_for_all_chunks_together(path, content, name, recover):
    packed = pytest.importorskip("zstandard").compress(content)
    with_chunk(path, b"zstd", packed, len(content), count=20)
    tracemalloc.start()
    try:
        with pytest.raises(LimitError, match=f"{name}: expected at most 1100 bytes from one byte"):
            BagReader(path, TOPIC, recover=recover)
        assert tracemalloc.get_traced_memory()[1] < 120e6
    finally:
        tracemalloc.stop()


def test_overlapping_indexes_are_not_used(path):
    records = pytest.importorskip("mcap.records")
    builder = pytest.importorskip("mcap.data_stream").RecordBuilder()
    levels = 1000
    index = bytes(16 * levels)
    for _ in range(levels):
        # The first 15 of 16 bytes are the head of a record, the rest is the record before it.
        size = len(index)
        index = b"\0" + struct.pack("<BQHI", 7, 6 + size, 1, size) + index
    start = 8 + len(index)
    records.Schema(1, b"", "", "grid_map_msgs/msg/GridMap").write(builder)
    records.Channel(1, TOPIC, "cdr", {}, 1).write(builder)
    for level in range(levels):
        records.ChunkIndex(0, 0, "", 0, 0, 0, {1: 9 + 16 * level}, 0, 0).write(builder)
    count = sum(levels + level for level in range(levels))
    records.Statistics(0, 1, {1: count}, levels, count, 0, 0, 0, 1).write(builder)
    magic = b"\x89MCAP0\r\n"
    footer = record(2, struct.pack("<QQI", start, 0, 0))
    path.write_bytes(magic + index + builder.end() + footer + magic)
    assert_refused_without_memory(path, "bytes are missing")


def test_index_that_many_chunks_share_is_not_used(path):
    make_reader = pytest.importorskip("mcap.reader").make_reader

    data = write_mcap(path, [1, 2, 3], chunk_size=1, enable_crcs=False).read_bytes()
    with path.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    ((channel, shared),) = chunks[0].message_index_offsets.items()
    for chunk in chunks:
        offset = chunk.message_index_offsets[channel]
        data = data.replace(
            struct.pack("<HQ", channel, offset), struct.pack("<HQ", channel, shared)
        )
    path.write_bytes(data)
    assert len(chunks) == 3
    assert [*map(number_of, bag_maps(path, TOPIC))] == [1, 2, 3]


@pytest.mark.parametrize("length", [2**31, 2**63, 2**64 - 1])
def test_record_longer_than_the_file_is_refused(path, length):
    data = bytearray(write_mcap(path, [1], use_chunking=False).read_bytes())
    data[9:17] = struct.pack("<Q", length)
    data[-28:-20] = bytes(8)  # no summary: the file is scanned
    path.write_bytes(data)
    assert_refused_without_memory(path, "are missing")


def test_invalid_message_names_its_file_and_number(path):
    data = write_mcap(path, [1, 2], use_chunking=False, enable_crcs=False).read_bytes()
    path.write_bytes(data.replace(b"\x04\x00\x00\x00map\x00", b"\xff\xff\xff\x7fmap\x00"))
    with BagReader(path) as reader:
        assert len(reader) == 2
        with pytest.raises(BagError, match=rf"{path}: map 1 on /grid_map: .*frame_id"):
            reader[1].grid_map()


# --- databases ------------------------------------------------------------------------------------


def changed(path: Path, *statements: str) -> Path:
    shutil.copy(FILES["sqlite3"], path)
    with closing(sqlite3.connect(path)) as database, database:
        for statement in statements:
            database.execute(statement)
    return path


ENDLESS = """CREATE VIEW messages AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)
SELECT i AS id, 1 AS topic_id, i AS timestamp, zeroblob(9) AS data FROM n"""

GENERATED = "ALTER TABLE messages ADD COLUMN data AS (zeroblob(900000000))"
VIRTUAL = "CREATE VIRTUAL TABLE messages USING fts5(id, topic_id, timestamp, data)"


@pytest.mark.parametrize(
    ("statements", "reason"),
    [
        (["DROP TABLE topics"], "not of a bag: no tables of messages"),
        (["ALTER TABLE messages RENAME TO old", ENDLESS], "no tables of messages"),
        (["UPDATE messages SET data = 'text' WHERE id = 3"], "message of time .* is damaged"),
        (["UPDATE messages SET timestamp = 'now' WHERE id = 3"], "a time that is no integer"),
        (["ALTER TABLE messages DROP COLUMN data"], "no tables of messages"),
        (["ALTER TABLE messages DROP COLUMN data", GENERATED], "no tables of messages"),
        (["ALTER TABLE messages RENAME TO old", VIRTUAL], "no tables of messages"),
        (["UPDATE messages SET data = zeroblob(900) WHERE id = 3"], "map 2 on /grid_map: "),
        (["UPDATE topics SET name = CAST(x'ff' AS TEXT)"], "UTF-8"),
    ],
    ids=range(9),
)
def test_database_that_is_no_bag_is_refused(path, statements, reason):
    with pytest.raises(BagError, match=f"(?s){path}.*{reason}"):
        read_all(changed(path, *statements))


def with_repeated_page(path: Path, table: str) -> Path:
    """Write a database whose table names its only page of rows some 400,000 times."""
    changed(path, "DELETE FROM messages WHERE id > 3")
    with closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE messages SET data = x''")
        database.commit()
        database.execute("VACUUM")
        (size,) = database.execute("PRAGMA page_size").fetchone()
        query = "SELECT rootpage FROM sqlite_master WHERE name = ?"
        (root,) = database.execute(query, (table,)).fetchone()
    data = path.read_bytes()
    place = slice((root - 1) * size, root * size)
    page = data[place]
    for _ in range(2):
        # An inner page of one cell, to which all its places point.
        child = (len(data) + len(page)) // size
        count = (size - 12) // 6
        data += page
        page = struct.pack(">BHHHBI", 5, 0, count, size - 5, 0, child)
        page += struct.pack(">H", size - 5) * count
        page = page.ljust(size - 5, b"\0") + struct.pack(">IB", child, 127)
    data = data[: place.start] + page + data[place.stop :]
    path.write_bytes(data[:28] + struct.pack(">I", len(data) // size) + data[32:])
    return path


@pytest.mark.parametrize("table", ["messages", "topics"])
def test_page_that_a_table_repeats_is_refused(path, table):
    with_repeated_page(path, table)
    assert_refused_without_memory(path, "its tables have more rows than fit into the file")


def test_messages_of_a_database_beyond_the_limit_are_refused(path):
    changed(path)
    with (
        changed_limits(max_bytes=27 * 256),
        pytest.raises(LimitError, match=r"the list of its messages: .* 6912 bytes, got 7168"),
    ):
        BagReader(path, TOPIC)
    with changed_limits(max_bytes=28 * 256):
        assert len(BagReader(path, TOPIC)) == 28


def test_topic_of_no_messages_has_no_map(path):
    with pytest.raises(BagError, match="no map -1: 0 maps on /grid_map"):
        load_from_bag(changed(path, "DELETE FROM messages"), TOPIC)


def test_damaged_index_of_times_hides_no_message(path):
    assert read_all(changed(path, "DROP INDEX timestamp_idx")) == read_all(FILES["sqlite3"])


# --- metadata -------------------------------------------------------------------------------------


@pytest.fixture
def bag(tmp_path) -> Path:
    save_to_bag(numbered_map(1), tmp_path / "bag", TOPIC)
    return tmp_path / "bag"


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "'rosbag2_bagfile_information' is missing"),
        ("[1, 2]", "'rosbag2_bagfile_information' is missing"),
        ("rosbag2_bagfile_information: 3", "is missing"),
        ("rosbag2_bagfile_information: {a: b}", "expected a list of names"),
        ("rosbag2_bagfile_information: {relative_file_paths: [1]}", "expected a list of names"),
        ("rosbag2_bagfile_information: {relative_file_paths: []}", "has no files"),
        ("rosbag2_bagfile_information: {relative_file_paths: [a]}", "its file a is missing"),
        ("rosbag2_bagfile_information: {relative_file_paths: ['']}", "is missing"),
        ("{", "no valid YAML"),
        ("\0", "no valid YAML"),
        (b"\xff\xfe\xff", "no valid YAML"),
    ],
    ids=range(13),
)
def test_damaged_metadata_is_refused(bag, text, reason):
    (bag / "metadata.yaml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(GridMapError, match=rf"{bag}.*{reason}"):
        load_from_bag(bag)


def test_path_out_of_the_bag_is_not_followed(bag, tmp_path):
    (bag / "bag_0.mcap").rename(tmp_path / "other.mcap")
    for name in ("../other.mcap", str(tmp_path / "other.mcap")):
        text = yaml.safe_dump({"rosbag2_bagfile_information": {"relative_file_paths": [name]}})
        (bag / "metadata.yaml").write_text(text)
        with pytest.raises(BagError, match=r"its file other\.mcap is missing"):
            load_from_bag(bag)


def test_folder_without_metadata_is_refused_and_its_file_named(bag):
    (bag / "metadata.yaml").unlink()
    with pytest.raises(BagError, match=r"without metadata\.yaml; read bag_0\.mcap"):
        load_from_bag(bag)


@pytest.mark.parametrize("name", RECORDED_MOVES)
def test_counts_in_the_metadata_are_not_relied_on(name, tmp_path):
    shutil.copytree(DATA / name, tmp_path / "bag")
    text = (tmp_path / "bag" / "metadata.yaml").read_text()
    (tmp_path / "bag" / "metadata.yaml").write_text(text.replace("count: 32", "count: 9999999"))
    assert read_all(tmp_path / "bag") == read_all(DATA / name)
