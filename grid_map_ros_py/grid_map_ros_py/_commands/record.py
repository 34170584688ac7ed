# SPDX-License-Identifier: BSD-3-Clause
"""Record topics of any type to a bag, until Ctrl-C."""

import argparse
import math
import re
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache, partial
from pathlib import Path
from typing import Any

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory

from grid_map_core_py._commands import CommandError, UsageError, byte_count, message
from grid_map_core_py.errors import GridMapError

from ..bags._bag import BagWriter
from ..bags._storage import Topic, dump, qos_profile
from ..errors import BagError
from ._session import Session, check_positive, message_class, offers, quality

_LOOK_PERIOD = 0.2
"""Time between two checks for new publishers [s]."""

_REST = 0.2
"""Time after the end of a recording to process messages that have already arrived [s]."""

_DEPTH = 100
"""Queue depth of a subscription, for messages that arrive while the disk is busy."""

_FIELD = re.compile(r"^\s*([A-Za-z]\w*/)?([A-Z]\w*)(\[[^]]*\])?\s+[a-z]", re.MULTILINE)
"""Matches a field whose type is a message, not a primitive type such as `int32`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("topics", metavar="TOPIC", nargs="*", help="topics to record")
    add("destination", metavar="BAG", help="folder of the new bag (MCAP)")
    add("-a", "--all", action="store_true", help="record all topics except hidden ones")
    add("-f", "--force", action="store_true", help="replace an existing bag")
    add("--compress", action="store_const", const="zstd", default="none", help="compress with zstd")
    add("--duration", type=float, metavar="SECONDS", help="end after this time")
    add("--count", type=int, metavar="N", help="end after this number of messages")


def run(options: argparse.Namespace) -> int:
    """Record until a signal arrives, `--duration` or `--count` is reached, or the disk is full."""
    if options.all == bool(options.topics):
        raise UsageError("name the topics to record, or use --all")
    check_positive(options, "duration", "count")
    bag = BagWriter(
        options.destination, overwrite=options.force, compression=options.compress, in_place=True
    )
    for topic in options.topics or ["/topic"]:
        bag.check(topic)
    with Session("record") as session, ExitStack() as stack:
        # An existing bag is deleted only when the first message arrives.
        start = cache(lambda: stack.enter_context(bag))
        recorder = _Recorder(session, start, options.topics)
        recorder.record(options.duration or math.inf, options.count or math.inf)
        if not recorder.total:
            topics = ", ".join(recorder.counts) or "any topic"
            raise recorder.failure or CommandError(f"no messages on {topics}")
    for topic in [name for name, count in recorder.counts.items() if not count]:
        message(f"warning: no messages on {topic}")
    size = byte_count(recorder.size)
    message(f"recorded {recorder.total} messages, {size}, to {options.destination}")
    if recorder.failure:
        raise recorder.failure
    return 0


class _Recorder:
    """Subscribes to topics as they appear, and writes the serialized messages unchanged.

    If `topics` is empty, all topics are recorded, except hidden topics.

    Attributes:
        counts: number of recorded messages by topic, 0 for requested topics without messages.
        size: total size of all recorded messages [bytes].
        failure: error that ended the recording, such as a full disk.
    """

    def __init__(self, session: Session, start: Callable[[], BagWriter], topics: list[str]) -> None:
        self._session = session
        self._start = start
        self._all = not topics
        self.counts = {session.node.resolve_topic_name(topic): 0 for topic in topics}
        self.size = 0
        self.failure: BagError | None = None
        self._most = math.inf
        self._subscriptions: dict[str, tuple[dict[str, bool], Any]] = {}

    @property
    def total(self) -> int:
        return sum(self.counts.values())

    def record(self, seconds: float, most: float) -> None:
        """Record up to `most` messages for `seconds`; stop early on a signal or a full disk."""
        self._most = most
        end = time.monotonic() + seconds
        while not self._session.ended and (left := end - time.monotonic()) > 0:
            for topic, types in self._session.topics().items():
                hidden = any(part.startswith("_") for part in topic.split("/"))
                if not hidden if self._all else topic in self.counts:
                    self._follow(topic, types)
            self._session.spin(min(left, _LOOK_PERIOD))
        self._session.spin(_REST, until_ended=False)

    def _follow(self, topic: str, types: list[str]) -> None:
        """Subscribe to a topic with the strictest QoS that all current publishers offer.

        If a new publisher offers a weaker QoS, the recorder subscribes again.
        """
        publishers = self._session.publishers(topic)
        if not publishers:
            return
        every = [offers(one) for one in publishers]
        offered = {name: all(one[name] for one in every) for name in every[0]}
        before, subscription = self._subscriptions.get(topic, (None, None))
        if before is not None and not any(before[name] > offered[name] for name in offered):
            return
        if subscription:
            self._session.node.destroy_subscription(subscription)
            subscription = None
        try:
            kind = message_class(types)
            recorded = Topic(
                types[0],
                "cdr",
                dump([qos_profile(**one) for one in every]),
                _definition_of(types[0]),
                str(publishers[0].topic_type_hash),
            )
            write = partial(self._write, topic, recorded)
            qos = quality(**offered, depth=_DEPTH)
            subscription = self._session.node.create_subscription(kind, topic, write, qos, raw=True)
            if before is None:
                message(f"records {topic} ({types[0]})")
        except GridMapError as error:
            message(f"warning: {topic} is not recorded: {error}")
        self._subscriptions[topic] = (offered, subscription)

    def _write(self, topic: str, kind: Topic, data: bytes) -> None:
        if self.failure or self.total >= self._most:
            return
        try:
            self._start().write_serialized(topic, kind, time.time_ns(), data)
        except BagError as error:
            self.failure = error
            self._session.ended = True
            return
        self.counts[topic] = self.counts.get(topic, 0) + 1
        self.size += len(data)
        if self.total >= self._most:
            self._session.ended = True


def _definition_of(type_name: str) -> str:
    """Return the definitions of a message type and its nested types, as stored by rosbag2."""
    package, _, name = type_name.split("/")
    texts: dict[str, str] = {}
    pending = [f"{package}/{name}"]
    while pending:
        full_name = pending.pop()
        if full_name in texts:
            continue
        package, _, name = full_name.partition("/")
        try:
            path = Path(get_package_share_directory(package), "msg", f"{name}.msg")
            texts[full_name] = path.read_text(encoding="utf-8")
        except (PackageNotFoundError, OSError):
            return ""
        nested = _FIELD.findall(texts[full_name])
        pending += [f"{given or f'{package}/'}{kind}" for given, kind, _ in reversed(nested)]
    (_, first), *others = texts.items()
    parts = [first, *(f"MSG: {full_name}\n{text}" for full_name, text in others)]
    return f"\n{'=' * 80}\n".join(parts)
