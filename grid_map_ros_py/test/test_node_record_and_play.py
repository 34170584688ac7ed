# SPDX-License-Identifier: BSD-3-Clause
"""The commands `topics`, `record` and `play` as processes beside other nodes."""

import json
import re
import shlex
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest
from bags import numbered_map
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from grid_map_core_py.testing import assert_maps_equal
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import bag_topics, from_message, load_from_bag, save_to_bag, to_message
from grid_map_ros_py.bags._bag import BagFiles, BagWriter
from grid_map_ros_py.bags._storage import Topic, dump, qos_profile
from grid_map_ros_py.testing import Peer, Process, peer, wait_until

MAP, TEXT = "/grid_map", "/text"
SENSOR = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
SECOND = 10**9
GRID_MAP = [sys.executable, "-m", "grid_map_core_py"]


@contextmanager
def command(*words: object, largest_file: int | None = None) -> Iterator[Process]:
    """Run `grid-map`, which may write files of a size [kB]."""
    line = [*GRID_MAP, *map(str, words)]
    if largest_file is not None:
        line = ["bash", "-c", f"ulimit -f {largest_file}; exec {shlex.join(line)}"]
    process = Process(line)
    try:
        yield process
    finally:
        process.stop()


def publish_map_and_texts(node: Peer) -> None:
    """Publish a map, latched, and five texts; return when the subscribers have them."""
    node.publish(MAP, to_message(numbered_map(3)))
    for number in range(5):
        node.publish(TEXT, String(data=f"text {number}"), 10)
    for publisher in node.node.publishers:
        assert publisher.wait_for_all_acked(Duration(seconds=10))


def publish_until_ended(node: Peer, process: Process, topic: str, message, qos) -> int:
    """Publish a message again and again while a process runs, and return its exit code."""
    publisher = node.node.create_publisher(type(message), topic, qos)

    def publish_and_look() -> bool:
        publisher.publish(message)
        return not process.is_running

    node.wait_until(publish_and_look, "the end of the process")
    return process.wait()


def texts_in(bag: Path) -> list[str]:
    with BagFiles(bag) as files:
        found = [files.read(file, entry) for entry, file, _ in files.entries([TEXT])]
    return [deserialize_message(data, String).data for data in found]


def write_texts(bag: Path) -> Path:
    """Write texts, a fifth of a second apart, of a best-effort publisher, and a latched map."""
    kind = Topic("std_msgs/msg/String", "cdr", dump([qos_profile(reliable=False, latched=False)]))
    with BagWriter(bag) as writer:
        writer.write(MAP, numbered_map(1))
        for number in range(5):
            data = serialize_message(String(data=f"text {number}"))
            writer.write_serialized(TEXT, kind, SECOND + number * SECOND // 5, data)
    return bag


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_recording_ends_with_a_complete_bag(tmp_path, number):
    highlevel = pytest.importorskip("rosbags.highlevel")
    bag = tmp_path / "bag"
    with peer() as node, command("record", MAP, TEXT, "/silent", bag) as recorder:
        publish_map_and_texts(node)
        recorder.send_signal(number)
        assert recorder.wait() == 0, recorder.text
    assert "warning: no messages on /silent" in recorder.text
    assert "recorded 6 messages" in recorder.text
    assert_maps_equal(load_from_bag(bag), numbered_map(3))
    assert texts_in(bag) == [f"text {number}" for number in range(5)]
    with highlevel.AnyReader([bag]) as independent:
        (message,) = [
            independent.deserialize(data, connection.msgtype)
            for connection, _, data in independent.messages()
            if connection.topic == MAP
        ]
        offered = {one.topic: one.ext.offered_qos_profiles[0] for one in independent.connections}
    assert message.layers == ["elevation", "variance"]
    assert offered[MAP].durability.name == "TRANSIENT_LOCAL"
    assert offered[TEXT].durability.name == "VOLATILE"


def test_recording_all_topics_ends_after_a_count(tmp_path):
    with peer() as node, command("record", "--all", tmp_path / "bag", "--count", 3) as recorder:
        publish_map_and_texts(node)
        assert recorder.wait() == 0, recorder.text
    assert sum(topic.count for topic in bag_topics(tmp_path / "bag")) == 3


def test_recorder_keeps_what_fits_on_a_full_disk(tmp_path):
    bag = tmp_path / "bag"
    large = to_message(numbered_map(2, side=300))
    with peer() as node, command("record", MAP, bag, largest_file=8000) as recorder:
        assert publish_until_ended(node, recorder, MAP, large, 10) == 1
    assert "File too large" in recorder.text
    (topic,) = bag_topics(bag)
    assert topic.count >= 2
    assert f"recorded {topic.count} messages" in recorder.text
    assert_maps_equal(load_from_bag(bag), numbered_map(2, side=300))


def test_recorder_hears_best_effort_publishers_that_come_later(tmp_path):
    bag = tmp_path / "bag"
    with peer() as node, command("record", TEXT, bag, "--count", 2) as recorder:
        node.publish(TEXT, String(data="reliable"), 10)
        wait_until(lambda: "records /text" in recorder.text, "the subscription")
        assert publish_until_ended(node, recorder, TEXT, String(data="best effort"), SENSOR) == 0
    assert texts_in(bag)[-1] == "best effort"


def test_recording_nothing_leaves_nothing(tmp_path):
    with command("record", "/silent", tmp_path / "bag", "--duration", 0.5) as recorder:
        assert recorder.wait() == 1
    assert "error: no messages on /silent" in recorder.text
    assert not list(tmp_path.iterdir())


def test_recorder_replaces_a_bag_only_when_forced(tmp_path):
    save_to_bag(numbered_map(1), tmp_path / "bag", MAP)
    with command("record", MAP, tmp_path / "bag") as recorder:
        assert recorder.wait() == 1
    assert "already exists" in recorder.text
    for words, text in (("/silent", "no messages on /silent"), ("'/a b'", "the name of a topic")):
        line = shlex.split(f"record {words} {tmp_path}/bag -f --duration 0.5")
        with command(*line) as recorder:
            assert recorder.wait() == 1
        assert text in recorder.lines[-1]
        assert_maps_equal(load_from_bag(tmp_path / "bag"), numbered_map(1))
    (tmp_path / "bag").rename(tmp_path / "kept")
    (tmp_path / "bag").symlink_to("kept")
    with peer() as node, command("record", MAP, tmp_path / "bag", "-f", "--count", 1) as recorder:
        node.publish(MAP, to_message(numbered_map(2)))
        assert recorder.wait() == 0
    assert_maps_equal(load_from_bag(tmp_path / "kept"), numbered_map(2))


def test_player_loops_with_the_recorded_quality_of_service(tmp_path):
    with (
        peer() as node,
        command("play", write_texts(tmp_path / "bag"), "--loop", "--rate", 2) as player,
    ):
        node.listen(TEXT, String, SENSOR)
        node.listen(MAP, GridMapMessage)
        assert_maps_equal(from_message(node.expect(MAP, 2)), numbered_map(1))
        received = node.received[TEXT]
        begin = len(received)
        node.expect(TEXT, begin + 10)
        numbers = [int(message.data.split()[1]) for message in received[begin:]]
        assert all((after - before) % 5 == 1 for before, after in pairwise(numbers))
        (offer,) = node.node.get_publishers_info_by_topic(MAP)
        assert offer.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        (offer,) = node.node.get_publishers_info_by_topic(TEXT)
        assert offer.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
        player.send_signal(signal.SIGINT)
        assert player.wait() == 0, player.text


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["/nothing"], "no topic '/nothing'; topics: /grid_map, /text"),
        (["--rate", "0"], "--rate: expected a positive number, got 0"),
    ],
)
def test_player_names_what_cannot_be_published(tmp_path, words, text):
    with command("play", write_texts(tmp_path / "bag"), *words) as player:
        assert player.wait() in (1, 2)
    assert text in player.text


UNKNOWN = {
    "/parts": ("std_msgs/String", ""),
    "/program": ("antigravity/msg/String", ""),
    "/missing": ("std_msgs/msg/Nothing", ""),
    "/service": ("rcl_interfaces/srv/GetParameters", ""),
    "/quality": ("std_msgs/msg/String", "[1]"),
}
"""Types and qualities of service of topics by their names."""


def test_player_skips_topics_that_it_cannot_publish(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        for name, (type_name, qos) in UNKNOWN.items():
            writer.write_serialized(name, Topic(type_name, "cdr", qos), SECOND, b"")
    with command("play", tmp_path / "bag") as player:
        assert player.wait() == 1
    assert player.text.count(" is not published: ") == len(UNKNOWN) == len(player.lines) - 1
    assert player.text.count(" is not installed\n") == len(UNKNOWN) - 1
    assert "/missing is not published: the message type 'std_msgs/msg/Nothing' is" in player.text


def test_wrong_settings_of_ros_are_one_error():
    lister = Process([*GRID_MAP, "topics"], {"ROS_DOMAIN_ID": "many"})
    assert lister.wait() == 1
    assert lister.lines[-1].startswith("grid-map: error: ROS does not start: ")
    assert "Traceback" not in lister.text


def test_topics_are_listed_with_their_publishers():
    with peer() as node:
        node.listen("/heard", String)
        node.node.create_publisher(GridMapMessage, MAP, 1)
        with command("topics", "--json") as lister:
            assert lister.wait() == 0
        with command("topics") as table:
            assert table.wait() == 0
    found = {topic["name"]: topic for topic in json.loads(lister.text)}
    assert found[MAP]["publishers"] == [{"node": "/peer", "reliable": True, "latched": False}]
    assert found["/heard"]["subscribers"] == [{"node": "/peer"}]
    assert re.search(
        rf"^{MAP} +grid_map_msgs/msg/GridMap +1 +0 +reliable$", table.text, re.MULTILINE
    )
