# SPDX-License-Identifier: BSD-3-Clause
"""Messages that the C++ nodes published, from `data/`; read without our own reader of bags."""

import array
import sqlite3
import struct
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from rclpy.serialization import deserialize_message

DATA = Path(__file__).parent / "data"


class Recorded(NamedTuple):
    raw: bytes
    message: Any


@cache
def recorded(recording: str, topic: str, message_type: type) -> list[Recorded]:
    """Return the messages of a topic in time order, serialized and deserialized."""
    bag = DATA / f"{recording}_outputs.mcap"
    messages = _from_mcap(bag, topic) if bag.is_file() else _from_sqlite(recording, topic)
    assert messages, f"no message on {topic} in {recording}"
    return [Recorded(raw, deserialize_message(raw, message_type)) for raw in messages]


def bits(value: Any) -> Any:
    """Return all fields of a message bit by bit.

    Serialized messages cannot be compared: the bytes between aligned fields are whatever was in the
    memory before.
    """
    if hasattr(value, "get_fields_and_field_types"):
        return {name: bits(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, array.array):
        return value.typecode, value.tobytes()
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.tobytes()
    if isinstance(value, list):
        return [bits(entry) for entry in value]
    return struct.pack("d", value) if isinstance(value, float) else value


def _from_mcap(bag: Path, topic: str) -> list[bytes]:
    with bag.open("rb") as file:
        reader = pytest.importorskip("mcap.reader").make_reader(file)
        return [message.data for _, _, message in reader.iter_messages(f"/{topic}")]


def _from_sqlite(recording: str, topic: str) -> list[bytes]:
    bag = DATA / f"{recording}_sqlite" / f"{recording}_sqlite_0.db3"
    query = (
        "SELECT data FROM messages JOIN topics ON topics.id = topic_id"
        " WHERE name = ? ORDER BY timestamp"
    )
    with closing(sqlite3.connect(f"file:{bag}?mode=ro", uri=True)) as database:
        return [raw for (raw,) in database.execute(query, (f"/{topic}",))]
