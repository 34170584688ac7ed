# SPDX-License-Identifier: BSD-3-Clause
"""The sqlite3 files of bags."""

import sqlite3
from collections.abc import Collection, Iterator
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..errors import BagError
from ._storage import VERSION, Entry, Topic, check_entries, dump, most_entries, ros_distro

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
"""Tables as rosbag2 of ROS 2 Jazzy makes them."""


_COLUMNS = {
    *(f"topics.{name}" for name in ("id", "name", "type", "serialization_format")),
    *(f"messages.{name}" for name in ("id", "topic_id", "timestamp", "data")),
}
"""Columns that are read."""

_STEPS_PER_BYTE, _FREE_STEPS = 4, 100_000
"""Steps that a query may take, per byte of the file, and besides: a message of 9 bytes, the least
that there can be, takes some 15."""

_STEPS = 10_000
"""Steps between two looks at the number of steps."""


class SqliteWriter:
    """Writes serialized messages to a new database.

    Args:
        path: the file.
        in_memory: write the file at the end. sqlite3 resolves a path before it opens the file, so
            that a link can divert it meanwhile.
    """

    def __init__(self, path: Path, *, in_memory: bool = False) -> None:
        self._database = sqlite3.connect(":memory:" if in_memory else path)
        self._path = path if in_memory else None
        # The file is renamed into its place when it is complete; a journal would protect nothing.
        self._database.executescript("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;")
        self._database.executescript(_SCHEMA)
        self._insert("schema", _SCHEMA_VERSION, ros_distro())
        self._types = set[str]()
        self._topics: dict[str, int] = {}

    def write(self, topic: str, kind: Topic, time: int, data: bytes) -> None:
        """Append a message."""
        if topic not in self._topics:
            self._topics[topic] = len(self._topics) + 1
            self._add(topic, kind)
        self._insert("messages", None, self._topics[topic], time, data)

    def _add(self, topic: str, kind: Topic) -> None:
        key = self._topics[topic]
        self._insert("topics", key, topic, kind.type, kind.encoding, kind.qos, kind.type_hash)
        if kind.type not in self._types:
            self._types.add(kind.type)
            encoding = "ros2msg" if kind.definition else ""
            self._insert(
                "message_definitions", None, kind.type, encoding, kind.definition, kind.type_hash
            )

    def finish(self, information: object) -> None:
        """Write the metadata of the bag and close the file."""
        self._insert("metadata", None, VERSION, dump(information))
        self._database.commit()
        if self._path is not None:
            with self._path.open("xb") as file:
                file.write(self._database.serialize())
        self._database.close()

    def close(self) -> None:
        """Close the file, which is no bag unless it is finished."""
        self._database.close()

    def _insert(self, table: str, *values: object) -> None:
        marks = ", ".join("?" * len(values))
        self._database.execute(f"INSERT INTO {table} VALUES ({marks})", values)


class SqliteFile:
    """A database of rosbag2, of any version of its schema, open for reading only."""

    lost = 0
    """A damaged database is not read."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._size = path.stat().st_size
        # A recorder that was killed, or still writes, leaves messages in a log beside the database.
        log = path.with_name(path.name + "-wal")
        mode = "mode=ro"
        if log.exists() and log.stat().st_size > 0:
            self._size += log.stat().st_size
        else:
            self._check_size()
            mode += "&immutable=1"
        self._database = sqlite3.connect(f"file:{quote(str(path))}?{mode}", uri=True)
        self._database.set_progress_handler(self._count_steps, _STEPS)
        try:
            # Malicious files may hold views, virtual tables and generated columns of these names,
            # which cost any time and memory. The pragma does not list generated columns.
            query = """
                SELECT tables.name || '.' || columns.name
                FROM sqlite_master AS tables, pragma_table_info(tables.name) AS columns
                WHERE tables.type = 'table' AND tables.rootpage > 0
            """
            columns = {name for (name,) in self._rows(query)}
            if not columns >= _COLUMNS:
                raise BagError(path, "a database, but not of a bag: no tables of messages")
            # The oldest bags have no quality of service.
            qos = "offered_qos_profiles" if "topics.offered_qos_profiles" in columns else "''"
            query = f"SELECT id, name, type, serialization_format, {qos} FROM topics"
            self._names, self.topics = dict[Any, str](), dict[str, Topic]()
            for key, name, *kind in self._rows(query):
                self._names[key] = str(name)
                self.topics[str(name)] = Topic(*map(str, kind))
        except BaseException:
            self.close()
            raise

    def entries(self, topics: Collection[str]) -> list[tuple[Entry, str]]:
        """Return times and places of the messages on topics, in time order, with their topics."""
        self._database.create_function("is_wanted", 1, topics.__contains__)
        # Reads the table itself, because a damaged index would hide rows.
        query = """
            SELECT timestamp, messages.id, topic_id FROM messages NOT INDEXED
            WHERE topic_id IN (SELECT id FROM topics WHERE is_wanted(name))
        """
        rows = islice(self._rows(query), most_entries(self._size) + 1)
        found = [(Entry(time, key), self._names[topic]) for time, key, topic in rows]
        check_entries(self._path, len(found), self._size)
        if not all(isinstance(value, int) for entry, _ in found for value in entry):
            raise BagError(self._path, "a message has a time that is no integer")
        return sorted(found)

    def read(self, entry: Entry) -> bytes:
        """Return a message as it was recorded."""
        query = "SELECT data FROM messages WHERE id = ?"
        row = next(self._rows(query, entry.place), None)
        if row is None or not isinstance(row[0], bytes):
            raise BagError(self._path, f"the message of time {entry.time} is damaged")
        data: bytes = row[0]
        return data

    def _rows(self, query: str, *values: object) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of a query, which takes no more time than the size of the file permits.

        A malicious file names its pages again and again.
        """
        self._steps = _FREE_STEPS + _STEPS_PER_BYTE * self._size
        try:
            yield from self._database.execute(query, values)
        except sqlite3.OperationalError as error:
            if self._steps >= 0:
                raise
            reason = "is damaged: its tables have more rows than fit into the file"
            raise BagError(self._path, reason) from error

    def _count_steps(self) -> bool:
        """Return whether the query has to end."""
        self._steps -= _STEPS
        return self._steps < 0

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def _check_size(self) -> None:
        """Refuse a file that ends before its last page, which sqlite3 takes for a page of zeros."""
        with self._path.open("rb") as file:
            head = file.read(32)
        size, count = int.from_bytes(head[16:18], "big"), int.from_bytes(head[28:32], "big")
        size = 65536 if size == 1 else size
        if len(head) < 32 or size * count > self._path.stat().st_size:
            raise BagError(self._path, "is cut off: the copy is not complete")
