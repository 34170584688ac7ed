# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Messages with long sequences of small messages, serialized from arrays.

A marker with 280 000 points would need as many Python objects, and a second. Here the message is
written in the CDR encoding, which publishers accept in place of a message, and its long sequences
are copied from arrays.
"""

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

_HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian

_CODES = {
    "boolean": "?",
    "int8": "b",
    "uint8": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float": "f",
    "double": "d",
}


def serialize(message: Any, arrays: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Return a message in CDR, with some of its sequences taken from arrays.

    Args:
        message: any ROS message; the values of the fields in `arrays` are ignored.
        arrays: (N, k) for a sequence of N messages that consist of k numbers of one type, (N,) for
            a sequence of N numbers; the dtype must be the type on the wire.

    Raises:
        AttributeError: the message has no such field.
    """
    for name in arrays:
        getattr(message, name)
    writer = _Writer()
    for name, kind in message.get_fields_and_field_types().items():
        if name in arrays:
            writer.array(arrays[name])
        else:
            writer.value(getattr(message, name), kind)
    return writer.joined()


class _Writer:
    """Collects pieces of a message, each aligned to its own size as CDR demands."""

    def __init__(self) -> None:
        self._pieces: list[bytes | memoryview] = []
        self._size = 0

    def joined(self) -> bytes:
        return b"".join([_HEADER, *self._pieces])

    def value(self, value: Any, kind: str) -> None:
        if kind in _CODES:
            self._number(_CODES[kind], value)
        elif kind.startswith("string"):
            self._text(value)
        elif kind.startswith("sequence<"):
            self._number("I", len(value))
            self._items(value, kind.removeprefix("sequence<").rstrip(">").split(",")[0])
        elif kind.endswith("]"):
            self._items(value, kind.split("[")[0])
        else:
            self._message(value)

    def array(self, values: npt.NDArray[Any]) -> None:
        self._number("I", len(values))
        if values.size:
            self._align(values.itemsize)
            contiguous = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
            self._add(contiguous.data.cast("B"))

    def _message(self, message: Any) -> None:
        for name, kind in message.get_fields_and_field_types().items():
            self.value(getattr(message, name), kind)

    def _items(self, items: Any, kind: str) -> None:
        for item in items:
            self.value(item, kind)

    def _text(self, text: str) -> None:
        data = text.encode() + b"\0"
        self._number("I", len(data))
        self._add(data)

    def _number(self, code: str, value: Any) -> None:
        data = struct.pack("<" + code, value)
        self._align(len(data))
        self._add(data)

    def _align(self, size: int) -> None:
        self._add(bytes(-self._size % size))

    def _add(self, data: bytes | memoryview) -> None:
        self._pieces.append(data)
        self._size += len(data)
