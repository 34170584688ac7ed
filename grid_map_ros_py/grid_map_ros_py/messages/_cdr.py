# SPDX-License-Identifier: BSD-3-Clause
"""Reads and writes messages in CDR, the serialization format of DDS, without rclpy."""

import array
import re
import struct
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from ..errors import MessageError
from ._definition import FIELDS_BY_TYPE
from ._packages import messages_of

MessageType: TypeAlias = type | str
"""Message class, or a name in `FIELDS_BY_TYPE`; these types need no message package."""

Buffer: TypeAlias = "bytes | bytearray | memoryview | array.array[Any]"
"""Types that hold contiguous bytes, such as a serialized message."""

_HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian
_ORDERS = {0: ">", 1: "<"}
"""Byte order for each representation identifier of plain CDR (DDS-XTypes, 7.6.3.1.2)."""

_CODES = {
    "boolean": "?",
    "octet": "c",
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
_TYPE = re.compile(
    r"sequence<(?P<items>.+?)(, (?P<bound>\d+))?>"
    r"|(?P<item>.+)\[(?P<count>\d+)\]"
    r"|string(<(?P<length>\d+)>)?"
    r"|(?P<package>\w+)/(?P<name>\w+)"
)
"""Matches the field types that `get_fields_and_field_types` returns, except those in `_CODES`."""

_NONE: Mapping[str, npt.NDArray[Any]] = {}


def serialize(
    message: Any,
    arrays: Mapping[str, npt.NDArray[Any]] = _NONE,
    message_type: MessageType | None = None,
) -> bytes:
    """Serialize a message to CDR; publishers accept the result in place of a message.

    Args:
        message: any ROS message, or an object with the same attributes, such as a result of `view`.
        arrays: arrays that replace sequence fields of `message`, by field name. Arrays are faster
            for long sequences. A sequence of N numbers has the shape (N,). A sequence of N messages
            with k numbers each has the shape (N, k). The dtype must match the numbers in the field.
        message_type: type of the message, as for `view`; None means the class of `message`.
    """
    for name in arrays:
        getattr(message, name)
    writer = _Writer()
    _struct(type(message) if message_type is None else message_type).write(writer, message, arrays)
    return writer.joined()


def view(data: Buffer, message_type: MessageType) -> Any:
    """Deserialize a CDR message to an object with the attributes of the message.

    Nested messages become such objects too. Sequences of numbers become NumPy arrays. If the
    message is little-endian, the arrays share the memory of `data`. Bytes after the message are
    ignored.

    Args:
        data: the serialized message, little- or big-endian.
        message_type: class of the message. The types that `grid-map view` shows can also be given
            by name, such as "grid_map_msgs/GridMap". A name requires no message package.
    """
    return _struct(message_type).read(_Reader(data))


@dataclass(frozen=True)
class Reordered:
    """Values (N,) to serialize in a new order; `write` copies them to an array in that order."""

    values: npt.NDArray[Any]
    write: Callable[[npt.NDArray[Any]], object]

    def __len__(self) -> int:
        return len(self.values)


class _Writer:
    """Collects the pieces of a serialized message, aligned as CDR requires."""

    def __init__(self) -> None:
        self._pieces: list[bytes | memoryview] = [_HEADER]
        self._reordered: dict[int, Reordered] = {}
        self._end = len(_HEADER)

    def joined(self) -> bytes:
        if not self._reordered:
            return b"".join(self._pieces)
        # `BytesIO` copies neither the initial zeros nor the returned bytes.
        stream, begin = BytesIO(bytes(self._end)), 0
        with stream.getbuffer() as memory:
            for piece in self._pieces:
                if one := self._reordered.get(begin):
                    one.write(np.frombuffer(memory, one.values.dtype, len(one), begin))
                else:
                    memory[begin : begin + len(piece)] = piece
                begin += len(piece)
        return stream.getvalue()

    def add(self, data: bytes | memoryview, alignment: int = 1) -> None:
        if padding := (len(_HEADER) - self._end) % alignment:
            self._pieces.append(bytes(padding))
        self._pieces.append(data)
        self._end += padding + len(data)

    def count(self, number: int) -> None:
        _COUNT.write(self, number)

    def array(self, values: npt.NDArray[Any]) -> None:
        if values.size:
            contiguous = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
            self.add(contiguous.data.cast("B"), values.itemsize)

    def reordered(self, one: Reordered) -> None:
        self.array(one.values)
        self._reordered[self._end - one.values.nbytes] = one


class _Reader:
    """Reads the bytes of a serialized message after the CDR header."""

    def __init__(self, data: Buffer) -> None:
        try:
            buffer = memoryview(data).cast("B")
        except TypeError as error:
            found = type(data).__name__
            raise MessageError("data", "the bytes of a serialized message", found) from error
        if len(buffer) < len(_HEADER):
            raise MessageError("encoding", f"{len(_HEADER)} bytes", len(buffer))
        number = int.from_bytes(buffer[:2])
        if number not in _ORDERS:
            raise MessageError("encoding", "plain CDR (0x0000 or 0x0001)", f"0x{number:04x}")
        self.order = _ORDERS[number]
        self.data = buffer[len(_HEADER) :]
        self._size = len(self.data)
        self._end = 0

    def step(self, size: int, alignment: int = 1, field: str = "") -> int:
        """Skip the next `size` bytes after alignment, and return their offset."""
        begin = self._end + -self._end % alignment
        if size > self._size - begin:
            raise MessageError(field, f"{size} bytes more", max(self._size - begin, 0))
        self._end = begin + size
        return begin

    def take(self, size: int, alignment: int = 1) -> memoryview:
        begin = self.step(size, alignment)
        return self.data[begin : begin + size]

    def count(self, bound: int, smallest: int) -> int:
        """Read a sequence length; raise `MessageError` if it exceeds `bound` or the data."""
        number: int = _COUNT.read(self)
        if number > bound:
            raise MessageError("", f"at most {bound} values", number)
        remaining = self._size - self._end
        if number * smallest > remaining:
            fitting = f"at most {remaining // smallest} values ({remaining} bytes more)"
            raise MessageError("", fitting, number)
        return number


# Each type has a codec; `smallest` is the minimum size of a serialized value [bytes].


class _Number:
    """Codec for a number; `code` is its format character in `struct`."""

    def __init__(self, code: str) -> None:
        self.code = code
        self.smallest = struct.calcsize("<" + code)
        self._pack = struct.Struct("<" + code).pack
        self._unpack = {order: struct.Struct(order + code).unpack_from for order in "<>"}

    def read(self, reader: _Reader) -> Any:
        begin = reader.step(self.smallest, self.smallest)
        return self._unpack[reader.order](reader.data, begin)[0]

    def write(self, writer: _Writer, value: Any) -> None:
        writer.add(self._pack(value), self.smallest)

    def read_array(self, reader: _Reader, count: int) -> npt.NDArray[Any]:
        if count == 0:
            return np.empty(0, self.code)
        data = reader.take(count * self.smallest, self.smallest)
        values = np.frombuffer(data, np.dtype(reader.order + self.code))
        return values.astype(self.code, copy=False)

    def write_array(self, writer: _Writer, values: Any) -> None:
        if isinstance(values, Reordered):
            writer.reordered(values)
        else:
            writer.array(np.asarray(values, self.code))


_COUNT = _Number("I")


@dataclass(frozen=True)
class _Text:
    bound: int
    smallest: int = 4

    def read(self, reader: _Reader) -> str:
        data = bytes(reader.take(reader.count(self.bound + 1, 1))).removesuffix(b"\0")
        try:
            text = data.decode()
        except UnicodeDecodeError:
            raise MessageError("", "a text in UTF-8", data) from None
        if "\0" in text:
            raise MessageError("", "a text without NUL", text)
        return text

    def write(self, writer: _Writer, value: str) -> None:
        try:
            data = value.encode() + b"\0"
        except UnicodeEncodeError:
            raise MessageError("", "a text that UTF-8 can hold", value) from None
        writer.count(len(data))
        writer.add(data)


class _Items:
    """Codec for an array of `count` values, or for a sequence of at most `bound` values."""

    def __init__(self, item: "_Codec", *, count: int | None = None, bound: int = 0) -> None:
        self._item = item
        self._count = count
        self._bound = bound
        self.smallest: int = 4 if count is None else count * item.smallest
        # Messages store booleans and bytes in lists, and all other numbers in arrays.
        self._numbers = item if isinstance(item, _Number) and item.code not in "?c" else None

    def read(self, reader: _Reader) -> Any:
        count = self._count
        if count is None:
            count = reader.count(self._bound, self._item.smallest)
        if self._numbers:
            return self._numbers.read_array(reader, count)
        items: list[Any] = []
        try:
            while len(items) < count:
                items.append(self._item.read(reader))
        except MessageError as error:
            raise _inside(f"[{len(items)}]", error) from None
        return items

    def write(self, writer: _Writer, value: Any) -> None:
        if self._count is None:
            writer.count(len(value))
        elif len(value) != self._count:
            raise MessageError("", f"{self._count} values", len(value))
        if self._numbers:
            self._numbers.write_array(writer, value)
            return
        for index, item in enumerate(value):
            try:
                self._item.write(writer, item)
            except MessageError as error:
                raise _inside(f"[{index}]", error) from None


class _Struct:
    def __init__(self, message_type: Any) -> None:
        if isinstance(message_type, str):
            self._name, types = message_type, FIELDS_BY_TYPE[message_type]
        else:
            self._name, types = message_type.__name__, message_type.get_fields_and_field_types()
        self._fields = {name: _codec(kind, f"{self._name}.{name}") for name, kind in types.items()}
        # A message without fields is serialized as one byte.
        self.smallest: int = sum(codec.smallest for codec in self._fields.values()) or 1

    def read(self, reader: _Reader) -> Any:
        if not self._fields:
            reader.step(1, field=self._name)
        values = {}
        for name, codec in self._fields.items():
            try:
                values[name] = codec.read(reader)
            except MessageError as error:
                raise _inside(name, error) from None
        return SimpleNamespace(**values)

    def write(
        self, writer: _Writer, value: Any, arrays: Mapping[str, npt.NDArray[Any]] = _NONE
    ) -> None:
        if not self._fields:
            writer.add(b"\0")
        for name, codec in self._fields.items():
            if name in arrays:
                writer.count(len(arrays[name]))
                writer.array(arrays[name])
                continue
            try:
                codec.write(writer, getattr(value, name))
            except MessageError as error:
                raise _inside(name, error) from None


_Codec: TypeAlias = _Number | _Text | _Items | _Struct

_struct = cache(_Struct)


def _codec(kind: str, field: str) -> _Codec:
    if kind in _CODES:
        return _Number(_CODES[kind])
    match = _TYPE.fullmatch(kind)
    if match is None:
        raise MessageError(field, "a type that can be serialized", kind)
    if items := match["items"]:
        return _Items(_codec(items, field), bound=int(match["bound"] or sys.maxsize))
    if item := match["item"]:
        return _Items(_codec(item, field), count=int(match["count"]))
    if name := match["name"]:
        is_known = kind in FIELDS_BY_TYPE
        return _struct(kind if is_known else getattr(messages_of(match["package"]), name))
    return _Text(int(match["length"] or sys.maxsize))


def _inside(name: str, error: MessageError) -> MessageError:
    """Return `error` with `name` prepended to the field path."""
    separator = "." if error.field and not error.field.startswith("[") else ""
    return MessageError(f"{name}{separator}{error.field}", error.expected, error.found)
