# SPDX-License-Identifier: BSD-3-Clause
"""Play back the messages of a bag, by default at the recorded speed."""

import argparse
import time
from collections.abc import Sequence
from typing import Any

from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException

from grid_map_core_py._commands import CommandError, message
from grid_map_core_py.errors import GridMapError, short
from grid_map_core_py.files._shared import parse_yaml

from ..bags._bag import BagFiles
from ..bags._storage import Entry
from ._session import Session, check_positive, message_class, quality

_DEPTH = 10
"""Number of messages that a publisher keeps for late-joining or slow subscribers."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("bag", metavar="BAG", help="folder of a bag, or its .mcap or .db3 file")
    add("topics", metavar="TOPIC", nargs="*", help="topics to publish (all)")
    add("--rate", type=float, default=1.0, help="speed compared with the recording (%(default)s)")
    add("--loop", action="store_true", help="begin again at the end")
    text = "time for subscribers to connect before the first message [s] (%(default)s)"
    add("--delay", type=float, default=1.0, metavar="SECONDS", help=text)


def run(options: argparse.Namespace) -> int:
    """Publish the messages until the bag ends or a signal arrives."""
    check_positive(options, "rate", "delay")
    with BagFiles(options.bag) as bag, Session("play") as session:
        publishers = _publishers(session, bag, options)
        entries = bag.entries(publishers)
        if not entries:
            raise CommandError(f"{options.bag}: no messages to publish")
        session.spin(options.delay)
        count = _play(session, bag, entries, publishers, options.rate)
        while options.loop and not session.ended:
            count += _play(session, bag, entries, publishers, options.rate)
        for publisher in publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=1))
    message(f"published {count} messages of {options.bag}")
    return 0


def _play(
    session: Session,
    bag: BagFiles,
    entries: Sequence[tuple[Entry, int, str]],
    publishers: dict[str, Any],
    rate: float,
) -> int:
    """Publish messages until the bag ends or a signal arrives; return their number."""
    begin = time.monotonic()
    for count, (entry, file, topic) in enumerate(entries):
        data = bag.read(file, entry)
        due = begin + (entry.time - entries[0][0].time) / rate / 1e9
        session.spin(due - time.monotonic())
        if session.ended:
            return count
        publishers[topic].publish(data)
    return len(entries)


def _publishers(session: Session, bag: BagFiles, options: argparse.Namespace) -> dict[str, Any]:
    """Create a publisher for each requested topic; warn about topics that cannot be published."""
    publishers = {}
    for topic in options.topics or sorted(bag.topics):
        if topic not in bag.topics:
            listed = ", ".join(sorted(bag.topics)) or "(none)"
            raise CommandError(f"{options.bag}: no topic {topic!r}; topics: {listed}")
        kind = bag.topics[topic]
        try:
            if kind.encoding != "cdr":
                raise CommandError(f"expected messages encoded as 'cdr', got {kind.encoding!r}")
            message_type = message_class([kind.type])
            # rosbag2 stores policy names; before ROS 2 Jazzy, it stored rmw policy numbers.
            profiles = parse_yaml(kind.qos, "quality of service") or [{}]
            if not (isinstance(profiles, list) and all(isinstance(one, dict) for one in profiles)):
                raise CommandError(f"expected a list of QoS profiles, got {short(profiles)}")
            reliable = all(one.get("reliability") in ("reliable", 1, None) for one in profiles)
            latched = all(one.get("durability") in ("transient_local", 1) for one in profiles)
            qos = quality(reliable=reliable, latched=latched, depth=_DEPTH)
            publishers[topic] = session.node.create_publisher(message_type, topic, qos)
        except (GridMapError, NameValidationException) as error:
            message(f"warning: {topic} is not published: {' '.join(str(error).split())}")
    return publishers
