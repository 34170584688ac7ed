# SPDX-License-Identifier: BSD-3-Clause
"""Reads and writes MCAP bag files with `rosbag2_py`, if the package `mcap` is not installed."""

import shutil
from collections import Counter
from collections.abc import Collection
from importlib import import_module
from pathlib import Path
from typing import Any

from grid_map_core_py.errors import MissingPackageError
from grid_map_core_py.files._shared import parse_yaml

from ._storage import Entry, Topic

_PRESETS = {"none": "", "zstd": "zstd_fast"}


def _opened(kind: str, uri: Path, preset: str = "") -> Any:
    rosbag2 = import_module("rosbag2_py")
    found = getattr(rosbag2, kind)()
    options = rosbag2.StorageOptions(uri=str(uri), storage_id="mcap", storage_preset_profile=preset)
    found.open(options, rosbag2.ConverterOptions("cdr", "cdr"))
    return found


class Rosbag2File:
    """An MCAP file, open for reading."""

    def __init__(self, path: Path, *, recover: bool = False) -> None:
        if recover:
            raise MissingPackageError("mcap", f"recovery of the bag {path}")
        self._reader: Any = _opened("SequentialReader", path)
        self.topics = {
            topic.name: Topic(topic.type, topic.serialization_format)
            for topic in self._reader.get_all_topics_and_types()
        }

    def entries(self, topics: Collection[str]) -> list[tuple[Entry, str]]:
        """Return (entry, topic) of each message on `topics`, in time order."""
        self._seek(0, topics)
        found, counts = list[tuple[Entry, str]](), Counter[tuple[str, int]]()
        while self._reader.has_next():
            topic, _, time = self._reader.read_next()
            if topic in topics:  # an empty filter accepts all topics
                # `read` skips earlier messages on the topic with the same time.
                found.append((Entry(time, (len(found), topic, counts[topic, time])), topic))
                counts[topic, time] += 1
        return sorted(found)

    def read(self, entry: Entry) -> bytes:
        _, topic, earlier = entry.place
        self._seek(entry.time, [topic])
        for _ in range(earlier):
            self._reader.read_next()
        return bytes(self._reader.read_next()[1])

    def close(self) -> None:
        self._reader = None

    def _seek(self, time: int, topics: Collection[str]) -> None:
        self._reader.set_filter(import_module("rosbag2_py").StorageFilter(topics=[*topics]))
        self._reader.seek(time)


class Rosbag2Writer:
    """Writes serialized messages to a new MCAP file."""

    def __init__(self, path: Path, compression: str = "none", **_: object) -> None:
        if compression not in _PRESETS:
            raise MissingPackageError("mcap", f"compression {compression!r}")
        self._path, self._topics = path, set[str]()
        # `rosbag2_py` can only write whole bags; `finish` moves the file out of this bag.
        self._folder = path.with_name(path.stem.removesuffix("_0"))
        self._writer: Any = _opened("SequentialWriter", self._folder, _PRESETS[compression])

    def write(self, topic: str, kind: Topic, time: int, data: bytes) -> None:
        if topic not in self._topics:
            self._topics.add(topic)
            profiles = [_quality(one) for one in parse_yaml(kind.qos, topic) or ()]
            metadata = import_module("rosbag2_py").TopicMetadata(
                len(self._topics), topic, kind.type, kind.encoding, profiles, kind.type_hash
            )
            self._writer.create_topic(metadata)
        self._writer.write(topic, data, time)

    def finish(self, _: object) -> None:
        """Close the file and move it to `path`."""
        self._writer.close()
        file = self._folder / self._path.name
        # The writer does not report a full disk, but the truncated file cannot be opened.
        Rosbag2File(file).close()
        file.rename(self._path)

    def close(self) -> None:
        """Close and delete the temporary bag. Without `finish`, the file is lost."""
        self._writer = None
        shutil.rmtree(self._folder, ignore_errors=True)


def _quality(profile: dict[str, Any]) -> Any:
    quality = import_module("rosbag2_py._storage").QoS(1)
    if profile.get("reliability") == "best_effort":
        quality = quality.best_effort()
    return quality.transient_local() if profile.get("durability") == "transient_local" else quality
