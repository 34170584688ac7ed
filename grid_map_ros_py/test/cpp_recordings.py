# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Messages that the C++ nodes published, from `data/`."""

import array
import importlib
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from mcap.reader import make_reader
from rclpy.serialization import deserialize_message

DATA = Path(__file__).parent / "data"


class Recorded(NamedTuple):
    raw: bytes
    message: Any


@cache
def recorded(file: str, topic: str) -> list[Recorded]:
    """Return the messages of a topic in time order, serialized and deserialized."""
    path = DATA / file
    assert path.is_file(), path
    read = _read_sqlite if path.suffix == ".db3" else _read_mcap
    found = [
        Recorded(raw, deserialize_message(raw, _message_class(name)))
        for name, raw in read(path, topic)
    ]
    assert found, f"no message on {topic} in {file}"
    return found


def bits(value: Any) -> Any:
    """Return all fields of a message, to the bit.

    Serialized messages cannot be compared: the bytes between aligned fields are whatever was in the
    memory before.
    """
    if hasattr(value, "get_fields_and_field_types"):
        return {name: bits(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, array.array):
        return value.typecode, value.tobytes()
    if isinstance(value, list):
        return [bits(entry) for entry in value]
    return struct.pack("d", value) if isinstance(value, float) else value


def _read_mcap(path: Path, topic: str) -> Iterator[tuple[str, bytes]]:
    with path.open("rb") as stream:
        for schema, _, message in make_reader(stream).iter_messages(topics=[topic]):
            assert schema is not None
            yield schema.name, message.data


def _read_sqlite(path: Path, topic: str) -> Iterator[tuple[str, bytes]]:
    query = (
        "SELECT type, data FROM messages JOIN topics ON topics.id = topic_id"
        " WHERE name = ? ORDER BY timestamp"
    )
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
        yield from database.execute(query, (topic,))


def _message_class(name: str) -> type:
    package, _, message = name.split("/")
    found: type = getattr(importlib.import_module(f"{package}.msg"), message)
    return found
