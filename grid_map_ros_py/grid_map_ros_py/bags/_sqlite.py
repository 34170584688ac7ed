# SPDX-License-Identifier: BSD-3-Clause
"""Reader and writer of sqlite3 bag files."""

import sqlite3
from collections.abc import Collection
from pathlib import Path
from urllib.parse import quote

from ..errors import BagError
from ._storage import VERSION, Entry, Topic, dump, ros_distro

MAGIC = b"SQLite format 3\0"

_SCHEMA_VERSION = 4
_SCHEMA = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(
    id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE topics(
    id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
    serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL,
    type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(
    id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
    encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE messages(
    id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
    data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
"""
"""Database schema of rosbag2 in ROS 2 Jazzy."""


class SqliteWriter:
    """Writes a new sqlite3 bag file; with `in_place`, written messages survive a crash."""

    def __init__(self, path: Path, *, in_place: bool = False) -> None:
        self._database = sqlite3.connect(path, isolation_level=None if in_place else "DEFERRED")
        # A file that is moved to its final path only when complete needs no journal.
        self._database.execute(f"PRAGMA journal_mode = {'WAL' if in_place else 'OFF'}")
        self._database.execute("PRAGMA synchronous = OFF")
        self._database.executescript(_SCHEMA)
        self._insert("schema", _SCHEMA_VERSION, ros_distro())
        self._types = set[str]()
        self._topics: dict[str, int] = {}

    def write(self, topic: str, kind: Topic, time: int, data: bytes) -> None:
        if kind.type not in self._types:
            self._types.add(kind.type)
            definition = ("ros2msg" if kind.definition else "", kind.definition, kind.type_hash)
            self._insert("message_definitions", None, kind.type, *definition)
        if topic not in self._topics:
            key = self._topics[topic] = len(self._topics) + 1
            self._insert("topics", key, topic, kind.type, kind.encoding, kind.qos, kind.type_hash)
        self._insert("messages", None, self._topics[topic], time, data)

    def finish(self, information: object) -> None:
        """Write the bag metadata, then close the file."""
        self._insert("metadata", None, VERSION, dump(information))
        self._database.commit()
        self._database.close()

    def close(self) -> None:
        """Close the file; call `finish` first, or the file is incomplete."""
        self._database.close()

    def _insert(self, table: str, *values: object) -> None:
        marks = ", ".join("?" * len(values))
        self._database.execute(f"INSERT INTO {table} VALUES ({marks})", values)


class SqliteFile:
    """A rosbag2 database of any schema version, open for reading."""

    def __init__(self, path: Path) -> None:
        # If the recorder is running or was killed, more messages are in the write-ahead log.
        log = path.with_name(path.name + "-wal")
        mode = "mode=ro"
        if not log.exists() or not log.stat().st_size:
            # sqlite3 reads missing pages at the end of a truncated file as zeros.
            with path.open("rb") as file:
                head = file.read(32)
            size, count = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
            size = 65536 if size == 1 else size
            if len(head) < 32 or size * count > path.stat().st_size:
                hint = f"'sqlite3 {path.name} .recover' reads the rest"
                raise BagError(path, f"is cut off: the copy is not complete; {hint}")
            mode += "&immutable=1"
        self._database = sqlite3.connect(f"file:{quote(str(path))}?{mode}", uri=True)
        try:
            # The oldest schema version does not store the quality of service.
            query = "SELECT name FROM pragma_table_info('topics')"
            has_qos = ("offered_qos_profiles",) in self._database.execute(query)
            qos = "offered_qos_profiles" if has_qos else "''"
            query = f"SELECT id, name, type, serialization_format, {qos} FROM topics"
            self._names, self.topics = dict[int, str](), dict[str, Topic]()
            for key, name, *kind in self._database.execute(query):
                self._names[key] = name
                self.topics[name] = Topic(*kind)
        except BaseException:
            self.close()
            raise

    def entries(self, topics: Collection[str]) -> list[tuple[Entry, str]]:
        """Return (entry, topic) of each message on `topics`, in time order."""
        keys = [key for key, name in self._names.items() if name in topics]
        marks = ", ".join("?" * len(keys))
        query = f"SELECT timestamp, id, topic_id FROM messages WHERE topic_id IN ({marks})"
        rows = self._database.execute(query, keys)
        return sorted((Entry(time, key), self._names[topic]) for time, key, topic in rows)

    def read(self, entry: Entry) -> bytes:
        query = "SELECT data FROM messages WHERE id = ?"
        ((data,),) = self._database.execute(query, (entry.place,))
        return bytes(data)

    def close(self) -> None:
        self._database.close()
