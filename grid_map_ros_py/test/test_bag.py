# SPDX-License-Identifier: BSD-3-Clause
"""Reading and writing bags, compared with the library rosbags and with C++ recordings."""

import shutil
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import yaml
from bags import DATA, SECOND, TOPIC, number_of, numbered_map, write_bag, write_mcap
from cpp_recordings import recorded
from hypothesis import given, strategies as st
from wire import assert_identical

from grid_map_core_py import GridMapError, LayerNotFoundError
from grid_map_core_py.testing import assert_maps_equal, grid_maps
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import (
    BagError,
    BagReader,
    BagTopic,
    bag_maps,
    bag_topics,
    from_message,
    load_from_bag,
    save_to_bag,
)
from grid_map_ros_py.bags._storage import GRID_MAP_TYPE
from grid_map_ros_py.messages._definition import TYPE_HASH

pytestmark = pytest.mark.needs("mcap", "rosbags")

COMPRESSIONS = ["none", "lz4", "zstd"]


@pytest.fixture
def bag(tmp_path) -> Path:
    """A bag of maps 3, 1, 2, written in that order."""
    save_to_bag(map(numbered_map, (3, 1, 2)), tmp_path / "bag", TOPIC)
    return tmp_path / "bag"


# --- round trips ----------------------------------------------------------------------------------


@given(
    grid_maps(("elevation", "größe/m")),
    st.sampled_from([("sqlite3", "none"), *(("mcap", name) for name in COMPRESSIONS)]),
)
def test_map_round_trips_bit_by_bit_with_start_index(grid_map, kind):
    storage, compression = kind
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag"
        save_to_bag(grid_map, path, TOPIC, storage=storage, compression=compression)
        assert_identical(load_from_bag(path, TOPIC, unwrap=False), grid_map)
        unwrapped = load_from_bag(path, TOPIC)
    assert unwrapped.start_index == (0, 0)
    assert_maps_equal(unwrapped, grid_map)


@pytest.mark.parametrize(
    ("options", "number"),
    [
        ({"index": 0}, 1),
        ({"index": -2}, 2),
        ({"time": 2 * SECOND - 1}, 1),
        ({"time": 2 * SECOND}, 2),
        ({"time": 99 * SECOND}, 3),
    ],
)
def test_index_or_time_selects_a_map(bag, options, number):
    assert number_of(load_from_bag(bag, TOPIC, **options)) == number


def test_only_the_wanted_layers_are_read_and_written(bag, tmp_path):
    assert load_from_bag(bag, layers=["variance"]).layers == ("variance",)
    save_to_bag(
        (load_from_bag(bag, index=i) for i in (0, 1)), tmp_path / "b", "/m", layers="variance"
    )
    assert [part.layers for part in bag_maps(tmp_path / "b")] == [("variance",)] * 2
    with pytest.raises(LayerNotFoundError):
        load_from_bag(bag, layers=["slope"])


def test_bag_topics_have_counts_and_times(bag):
    assert bag_topics(bag) == [BagTopic(TOPIC, GRID_MAP_TYPE, 3, SECOND, 3 * SECOND)]
    recording = DATA / "cpp_move_sqlite"
    grids, maps = sorted(bag_topics(recording), key=lambda topic: topic.count)
    assert (grids.name, grids.type) == ("/occupancy_grid", "nav_msgs/msg/OccupancyGrid")
    assert (maps.name, maps.holds_maps, grids.holds_maps) == (TOPIC, True, False)
    with BagReader(recording) as reader:
        times = [record.time for record in reader]
    assert (maps.count, maps.first, maps.last) == (len(times), times[0], times[-1])
    with pytest.raises(BagError, match="no such file or folder"):
        bag_topics(bag / "none")


def test_maps_are_written_and_read_one_at_a_time(tmp_path):
    taken = []

    def maps():
        for number in range(3):
            assert taken == [*range(number)]
            yield numbered_map(number)
            taken.append(number)

    save_to_bag(maps(), tmp_path / "bag", TOPIC)
    reading = bag_maps(tmp_path / "bag")
    assert number_of(next(reading)) == 0
    reading.close()


# --- refused input --------------------------------------------------------------------------------


def test_map_that_cannot_be_read_is_refused(bag, tmp_path):
    with pytest.raises(BagError, match="no map 3: 3 maps on /grid_map"):
        load_from_bag(bag, TOPIC, index=3)
    with pytest.raises(BagError, match="up to time 999999999; the first is of 1000000000"):
        load_from_bag(bag, TOPIC, time=SECOND - 1)
    path = write_mcap(tmp_path / "a.mcap", [1], encoding="json")
    with pytest.raises(BagError, match=r"a\.mcap: /grid_map is encoded as 'json', only 'cdr'"):
        load_from_bag(path)


def test_wrong_topic_is_refused_with_a_list_of_topics():
    listed = r"topics: /grid_map \(grid_map_msgs/msg/GridMap\), /occupancy_grid \(nav_msgs/msg"
    with pytest.raises(BagError, match=rf"no topic '/map'; {listed}"):
        load_from_bag(DATA / "cpp_move_mcap", "/map")
    with pytest.raises(BagError, match=rf"occupancy_grid is of type nav_msgs.*not.*{listed}"):
        load_from_bag(DATA / "cpp_move_sqlite", "/occupancy_grid")


def test_files_that_rosbag2_compressed_as_a_whole_are_refused(tmp_path):
    write_bag(tmp_path / "bag", [1], "sqlite3", compressed="file")
    with pytest.raises(BagError, match=r"its files are compressed \(zstd\).*ros2 bag convert"):
        load_from_bag(tmp_path / "bag")
    (file,) = (tmp_path / "bag").glob("*.zstd")
    with pytest.raises(BagError, match="is compressed as a whole; 'zstd -d' unpacks it"):
        load_from_bag(file)


@pytest.mark.parametrize(
    ("maps", "options", "text"),
    [
        ([], {}, "no maps to write"),
        ("no map", {}, "expected a GridMap to write, got str"),
        (numbered_map(-1), {}, "nanoseconds"),
        *(
            (numbered_map(1), {"topic": topic}, "expected the name of a topic")
            for topic in ("", "/", "a b", "/1a", "/a//b", "/größe")
        ),
        (numbered_map(1), {"compression": "gzip"}, "of mcap: expected 'none' or .*, got 'gzip'"),
        (
            numbered_map(1),
            {"storage": "sqlite"},
            "expected 'auto' or 'mcap' or 'sqlite3', got 'sqlite'",
        ),
    ],
)
def test_refused_save_leaves_nothing(tmp_path, maps, options, text):
    with pytest.raises(GridMapError, match=text):
        save_to_bag(maps, tmp_path / "bag", **{"topic": TOPIC, **options})
    assert list(tmp_path.iterdir()) == []


def test_bag_replaces_a_bag_by_default(bag):
    save_to_bag(numbered_map(8), bag, TOPIC)
    assert [number_of(grid_map) for grid_map in bag_maps(bag)] == [8]
    with pytest.raises(BagError, match="already exists"):
        save_to_bag(numbered_map(9), bag, TOPIC, overwrite=False)
    assert number_of(load_from_bag(bag)) == 8


def test_folder_that_is_no_bag_is_never_replaced(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "notes.txt").write_text("precious")
    with pytest.raises(BagError, match=r"is not a bag and is not replaced; it holds notes\.txt"):
        save_to_bag(numbered_map(1), tmp_path, TOPIC)
    with pytest.raises(BagError, match="is a file, and a bag is a folder"):
        save_to_bag(numbered_map(1), tmp_path / "notes.txt", TOPIC)
    with pytest.raises(BagError, match=r"a/b: cannot be written: there is no folder a$"):
        save_to_bag(numbered_map(1), "a/b", TOPIC)
    with pytest.raises(BagError, match="path: expected the folder of a bag, got ''"):
        save_to_bag(numbered_map(1), "", TOPIC)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_bag_inside_a_bag_is_refused(bag):
    with pytest.raises(BagError, match=r"is inside the bag bag\. Choose another folder"):
        save_to_bag(numbered_map(1), bag / "inner", TOPIC)
    save_to_bag(numbered_map(8), bag, TOPIC)
    assert number_of(load_from_bag(bag)) == 8


# --- what rosbag2 writes --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("storage", "recording", "file"),
    [("mcap", "cpp_move_mcap", "bag_0.mcap"), ("sqlite3", "cpp_move_sqlite", "bag_0.db3")],
)
def test_metadata_has_the_entries_of_rosbag2(tmp_path, storage, recording, file):
    save_to_bag(map(numbered_map, (3, 1, 2)), tmp_path / "bag", TOPIC, storage=storage)
    ours, theirs = (
        yaml.safe_load((path / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        for path in (tmp_path / "bag", DATA / recording)
    )
    topics = {
        found["topic_metadata"]["name"]: found for found in theirs["topics_with_message_count"]
    }
    theirs |= {
        "duration": {"nanoseconds": 2 * SECOND},
        "starting_time": {"nanoseconds_since_epoch": SECOND},
        "message_count": 3,
        "topics_with_message_count": [topics[TOPIC] | {"message_count": 3}],
        "relative_file_paths": [file],
    }
    theirs["files"] = [
        {"path": file} | {key: theirs[key] for key in theirs["files"][0].keys() - {"path"}}
    ]
    assert ours == theirs


def test_file_has_the_records_that_rosbag2_writes(bag):
    reader = pytest.importorskip("mcap.reader")
    ours, theirs = (
        reader.make_reader(path.open("rb"), validate_crcs=True)
        for path in (bag / "bag_0.mcap", DATA / "cpp_move_mcap" / "cpp_move_mcap_0.mcap")
    )
    assert ours.get_header().profile == theirs.get_header().profile == "ros2"
    (channel,) = ours.get_summary().channels.values()
    (model,) = (c for c in theirs.get_summary().channels.values() if c.topic == TOPIC)
    assert (channel.topic, channel.message_encoding) == (model.topic, model.message_encoding)
    assert {k: yaml.safe_load(v) for k, v in channel.metadata.items()} == {
        k: yaml.safe_load(v) for k, v in model.metadata.items()
    }
    statistics = ours.get_summary().statistics
    assert (statistics.message_count, statistics.message_start_time) == (3, SECOND)
    assert ours.get_summary().chunk_indexes
    times = [(m.log_time, m.publish_time) for _, _, m in ours.iter_messages()]
    assert times == [(SECOND, SECOND), (2 * SECOND, 2 * SECOND), (3 * SECOND, 3 * SECOND)]
    (metadata,) = ours.iter_metadata()
    *_, written_last = theirs.iter_metadata()
    assert metadata.name == written_last.name
    stored = yaml.safe_load(metadata.metadata["serialized_metadata"])
    assert stored.keys() == yaml.safe_load(written_last.metadata["serialized_metadata"]).keys()


def test_database_has_the_tables_and_rows_of_rosbag2(tmp_path):
    save_to_bag(map(numbered_map, (3, 1)), tmp_path / "bag", TOPIC, storage="sqlite3")
    recording = DATA / "cpp_move_sqlite" / "cpp_move_sqlite_0.db3"
    equal = f"""
        SELECT type, name, tbl_name FROM sqlite_master ORDER BY name;
        SELECT entry.name, info.* FROM sqlite_master AS entry,
            pragma_table_xinfo(entry.name) AS info ORDER BY entry.name, cid;
        SELECT * FROM schema;
        SELECT name, type, serialization_format, type_description_hash FROM topics
            WHERE name = '{TOPIC}';
        SELECT topic_type, encoding, type_description_hash FROM message_definitions
            WHERE topic_type = '{GRID_MAP_TYPE}';
        SELECT metadata_version FROM metadata ORDER BY id DESC LIMIT 1
    """
    profiles = f"SELECT offered_qos_profiles FROM topics WHERE name = '{TOPIC}'"
    metadata = "SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1"
    with (
        closing(sqlite3.connect(tmp_path / "bag" / "bag_0.db3")) as ours,
        closing(sqlite3.connect(f"file:{recording}?mode=ro", uri=True)) as theirs,
    ):
        for query in equal.split(";"):
            assert ours.execute(query).fetchall() == theirs.execute(query).fetchall()
        texts = {
            query: [yaml.safe_load(one.execute(query).fetchone()[0]) for one in (ours, theirs)]
            for query in (profiles, metadata)
        }
    assert texts[profiles][0] == texts[profiles][1]
    assert texts[metadata][0].keys() == texts[metadata][1].keys()
    stored = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    assert texts[metadata][0] == stored["rosbag2_bagfile_information"]


# --- bags of the C++ rosbag2 and of the library rosbags -------------------------------------------


@pytest.mark.parametrize(
    ("path", "recording", "topic"),
    [
        ("cpp_tutorial_outputs.mcap", "cpp_tutorial", "grid_map"),
        ("cpp_filters_outputs.mcap", "cpp_filters", "grid_map"),
        ("cpp_filters_outputs.mcap", "cpp_filters", "filtered_map"),
        ("cpp_move_sqlite", "cpp_move", "grid_map"),
        ("cpp_move_sqlite/cpp_move_sqlite_0.db3", "cpp_move", "grid_map"),
    ],
)
def test_recorded_cpp_maps_equal_those_read_by_rclpy(path, recording, topic):
    expected = recorded(recording, topic, GridMapMessage)
    with BagReader(DATA / path, f"/{topic}") as reader:
        assert [record.data for record in reader] == [one.raw for one in expected]
        for record, one in zip(reader, expected, strict=True):
            actual = record.grid_map(unwrap=False)
            assert_identical(actual, from_message(one.message, unwrap=False))


@pytest.mark.parametrize(
    "options", [{"storage": "sqlite3"}, *({"compression": name} for name in COMPRESSIONS)]
)
def test_rosbags_reads_new_bags(tmp_path, options):
    rosbag2, typesys = map(pytest.importorskip, ("rosbags.rosbag2", "rosbags.typesys"))
    maps = [numbered_map(number) for number in (1, 2)]
    save_to_bag(maps, tmp_path / "bag", TOPIC, **options)
    store = typesys.get_typestore(typesys.Stores.EMPTY)
    with rosbag2.Reader(tmp_path / "bag") as reader:
        (connection,) = reader.connections
        assert (connection.topic, connection.msgtype) == (TOPIC, GRID_MAP_TYPE)
        assert (connection.digest, connection.msgcount) == (TYPE_HASH, 2)
        store.register(typesys.get_types_from_msg(connection.msgdef.data, connection.msgtype))
        messages = list(reader.messages())
    for (_, time, data), grid_map in zip(messages, maps, strict=True):
        message = store.deserialize_cdr(data, GRID_MAP_TYPE)
        assert time == grid_map.timestamp
        assert message.layers == list(grid_map.layers)
        values = message.data[0].data.reshape(grid_map.size, order="F")
        np.testing.assert_array_equal(values, grid_map["elevation"])
        assert message.info.pose.position.x == grid_map.position[0]


@pytest.mark.parametrize("compressed", ["", "message"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_bags_of_rosbags_are_read(tmp_path, storage, compressed):
    bag = write_bag(tmp_path / "bag", [2, 1, 3], storage, compressed=compressed)
    assert [number_of(grid_map) for grid_map in bag_maps(bag)] == [1, 2, 3]
    (file,) = (path for path in bag.iterdir() if path.suffix != ".yaml")
    assert number_of(load_from_bag(file)) == 3


# --- files without an index, split bags -----------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        {"index_types": "NONE"},
        {"index_types": "CHUNK"},
        {"use_chunking": False},
        {"repeat_channels": False, "repeat_schemas": False},
        {"use_statistics": False, "use_summary_offsets": False},
        {"chunk_size": 1},
    ],
    ids=lambda options: "-".join(options),
)
def test_files_without_a_complete_index_are_read_by_scanning(tmp_path, options):
    path = write_mcap(tmp_path / "file.mcap", [3, 1, 2], **options)
    assert [number_of(grid_map) for grid_map in bag_maps(path)] == [1, 2, 3]


@pytest.mark.parametrize("old", [False, True])
def test_split_bag_is_read_in_time_order(tmp_path, old):
    folder = tmp_path / "bag"
    folder.mkdir()
    names = ["bag_0.mcap", "bag_1.mcap"]
    write_mcap(folder / names[0], [1, 4])
    write_mcap(folder / names[1], [3, 2, 5])
    # The first versions of rosbag2 included the folder.
    paths = [f"bag/{name}" if old else name for name in names]
    information = {"version": 3 if old else 9, "relative_file_paths": paths}
    text = yaml.safe_dump({"rosbag2_bagfile_information": information})
    (folder / "metadata.yaml").write_text(text)
    assert [number_of(grid_map) for grid_map in bag_maps(folder)] == [1, 2, 3, 4, 5]
    assert number_of(load_from_bag(folder, index=2)) == 3
    assert bag_topics(folder) == [BagTopic(TOPIC, GRID_MAP_TYPE, 5, SECOND, 5 * SECOND)]
    (folder / names[1]).unlink()
    with pytest.raises(BagError, match=r"its file bag_1\.mcap is missing"):
        load_from_bag(folder)


def test_old_bag_in_read_only_folder_is_read(tmp_path):
    shutil.copytree(DATA / "cpp_move_sqlite", tmp_path / "bag")
    with closing(sqlite3.connect(tmp_path / "bag" / "cpp_move_sqlite_0.db3")) as database:
        # The first versions of rosbag2 did not store the quality of service.
        database.execute("ALTER TABLE topics DROP COLUMN offered_qos_profiles")
    for path in (*(tmp_path / "bag").iterdir(), tmp_path / "bag"):
        path.chmod(0o555 if path.is_dir() else 0o444)
    assert load_from_bag(tmp_path / "bag").size == (70, 70)
    (tmp_path / "bag").chmod(0o755)
    assert len([*(tmp_path / "bag").iterdir()]) == 2
