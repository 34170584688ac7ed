# SPDX-License-Identifier: BSD-3-Clause
"""Stand-in for `rosbag2_py` of ROS 2 Jazzy, made of the package `rosbags`, for MCAP files."""

from dataclasses import dataclass, field
from importlib import import_module
from itertools import dropwhile
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from grid_map_ros_py.messages._definition import DEFINITION

kinds, rosbag2 = import_module("rosbags.interfaces"), import_module("rosbags.rosbag2")
McapReader = import_module("rosbags.rosbag2.storage_mcap").McapReader


@dataclass
class StorageOptions:
    uri: str
    storage_id: str = ""
    storage_preset_profile: str = ""


@dataclass
class ConverterOptions:
    input_serialization_format: str = ""
    output_serialization_format: str = ""


StorageFilter = SimpleNamespace


@dataclass
class QoS:
    """The real class has no getters."""

    _depth: int
    _reliability: Any = kinds.QosReliability.RELIABLE
    _durability: Any = kinds.QosDurability.VOLATILE

    def best_effort(self) -> "QoS":
        self._reliability = kinds.QosReliability.BEST_EFFORT
        return self

    def transient_local(self) -> "QoS":
        self._durability = kinds.QosDurability.TRANSIENT_LOCAL
        return self


@dataclass
class TopicMetadata:
    id: int
    name: str
    type: str
    serialization_format: str
    offered_qos_profiles: list[QoS] = field(default_factory=list)
    type_description_hash: str = ""


def _check(storage: StorageOptions, converter: ConverterOptions) -> None:
    assert isinstance(storage.uri, str)
    assert storage.storage_id == "mcap"
    assert converter == ConverterOptions("cdr", "cdr")


class SequentialReader:
    """As in rosbag2, a filter without topics accepts all, and a new filter keeps the position."""

    def open(self, storage: StorageOptions, converter: ConverterOptions) -> None:
        _check(storage, converter)
        self._file = McapReader(Path(storage.uri))
        self._file.open()
        self._filter = StorageFilter(topics=[])
        self.seek(0)

    def get_all_topics_and_types(self) -> list[TopicMetadata]:
        return [
            TopicMetadata(0, one.topic, one.msgtype, one.ext.serialization_format)
            for one in self._file.connections
        ]

    def set_filter(self, storage_filter: StorageFilter) -> None:
        self._filter = storage_filter

    def seek(self, time: int) -> None:
        names = self._filter.topics
        wanted = [one for one in self._file.connections if not names or one.topic in names]
        found = self._file.messages(wanted) if wanted else ()
        self._messages = dropwhile(lambda message: message[1] < time, found)
        self._next: Any = next(self._messages, None)

    def has_next(self) -> bool:
        return self._next is not None

    def read_next(self) -> tuple[str, bytes, int]:
        (connection, time, data), self._next = self._next, next(self._messages, None)
        return connection.topic, bytes(data), time


class SequentialWriter:
    def open(self, storage: StorageOptions, converter: ConverterOptions) -> None:
        _check(storage, converter)
        path = Path(storage.uri)
        self._bag = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP)
        self._bag.open()
        # `rosbags` names the file like the folder, and rosbag2 appends its number.
        self._wrong, self._right = path / f"{path.name}.mcap", path / f"{path.name}_0.mcap"
        self._topics: dict[str, Any] = {}

    def create_topic(self, topic: TopicMetadata) -> None:
        never = kinds.QosTime(9223372036, 854775807)
        self._topics[topic.name] = self._bag.add_connection(
            topic.name,
            topic.type,
            msgdef=DEFINITION,
            rihs01=topic.type_description_hash or "RIHS01_unknown",
            serialization_format=topic.serialization_format,
            offered_qos_profiles=[
                kinds.Qos(
                    kinds.QosHistory.UNKNOWN,
                    one._depth,
                    one._reliability,
                    one._durability,
                    *(never, never, kinds.QosLiveliness.AUTOMATIC, never),
                    avoid_ros_namespace_conventions=False,
                )
                for one in topic.offered_qos_profiles
            ],
        )

    def write(self, topic: str, data: bytes, time: int) -> None:
        assert isinstance(data, bytes)
        self._bag.write(self._topics[topic], time, data)

    def close(self) -> None:
        self._bag.close()
        self._wrong.rename(self._right)


_storage = ModuleType("rosbag2_py._storage")
_storage.QoS = QoS  # type: ignore[attr-defined]
