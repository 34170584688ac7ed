# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Reading the sqlite3 files of bags."""

import sqlite3
from pathlib import Path
from urllib.parse import quote

from ..errors import BagError
from ._storage import Entry, Topic

MAGIC = b"SQLite format 3\0"


class SqliteFile:
    """A database of rosbag2, of any version of its schema, open for reading only."""

    def __init__(self, path: Path) -> None:
        self._path = path
        if not _is_unfinished(path):
            self._check_size()
        mode = "mode=ro" if _is_unfinished(path) else "mode=ro&immutable=1"
        self._database = sqlite3.connect(f"file:{quote(str(path))}?{mode}", uri=True)
        try:
            self._check_tables()
            self.topics = self._read_topics()
        except BaseException:
            self.close()
            raise

    def entries(self, topic: str) -> list[Entry]:
        """Return the messages on a topic in time order, without reading them."""
        # The rows themselves, since a damaged index would hide some of them.
        query = """
            SELECT timestamp, messages.id FROM messages NOT INDEXED
            WHERE topic_id IN (SELECT id FROM topics WHERE name = ?)
        """
        rows = self._database.execute(query, (topic,)).fetchall()
        if not all(isinstance(time, int) and isinstance(key, int) for time, key in rows):
            raise BagError(self._path, "a message has a time that is no integer")
        return [Entry(*row) for row in sorted(rows)]

    def read(self, entry: Entry) -> bytes:
        """Return a message as it was recorded."""
        query = "SELECT data FROM messages WHERE id = ?"
        row = self._database.execute(query, (entry.place,)).fetchone()
        if row is None or not isinstance(row[0], bytes):
            raise BagError(self._path, f"the message of time {entry.time} is damaged")
        data: bytes = row[0]
        return data

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

    def _check_tables(self) -> None:
        # Damaged or malicious files may hold views of those names, which can be endless.
        query = "SELECT name FROM sqlite_master WHERE type = 'table'"
        tables = {name for (name,) in self._database.execute(query)}
        if not {"topics", "messages"} <= tables:
            raise BagError(self._path, "a database, but not of a bag: no tables of messages")

    def _read_topics(self) -> dict[str, Topic]:
        rows = self._database.execute("SELECT name, type, serialization_format FROM topics")
        return {str(name): Topic(str(kind), str(encoding)) for name, kind, encoding in rows}


def _is_unfinished(path: Path) -> bool:
    """Tell whether a recorder has left messages in a log beside the database, or still writes."""
    log = path.with_name(path.name + "-wal")
    return log.exists() and log.stat().st_size > 0
