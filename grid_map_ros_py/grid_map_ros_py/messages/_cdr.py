# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Serialization of messages to CDR, the byte format of DDS and of bags, without rclpy.

`serialize` works for every message type and gives the bytes of rclpy. Publishers accept them in
place of a message, which saves one Python object per element: rclpy takes a second for a marker
with 280 000 points.

`view` reads bytes without copies: it has the attributes of a message, and its sequences of numbers
are NumPy arrays that share the memory of the bytes. `serialize_view` is the way back.

Lengths in the bytes are checked against the bytes that remain. Damaged bytes raise one
`MessageError` that names the field, and take no more memory than a small multiple of their size.
"""

import array
import re
import struct
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import SEEK_CUR, BytesIO
from operator import attrgetter
from types import SimpleNamespace
from typing import Any, Protocol, TypeAlias, TypeGuard, cast

import numpy as np
import numpy.typing as npt

from ..errors import MessageError
from ._definition import FIELDS_BY_TYPE
from ._packages import messages_of

MessageType: TypeAlias = "type | str"
"""Class of a message, or a name in `FIELDS_BY_TYPE`, for which no message package is needed."""

Buffer: TypeAlias = "bytes | bytearray | memoryview | array.array[Any]"
"""Contiguous memory."""

_HEADER = b"\x00\x01\x00\x00"  # plain CDR, little-endian
_ORDERS = {0: ">", 1: "<"}
_OTHER_ENCODINGS = {
    2: "PL_CDR_BE",
    3: "PL_CDR_LE",
    6: "CDR2_BE",
    7: "CDR2_LE",
    8: "D_CDR2_BE",
    9: "D_CDR2_LE",
    10: "PL_CDR2_BE",
    11: "PL_CDR2_LE",
}
"""Representation identifiers of the DDS-XTypes specification, 7.6.3.1.2."""

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
"""Types other than numbers, as `get_fields_and_field_types` of a message class writes them."""

_OBJECTS = "?c"
"""Codes of values that messages keep in lists; sequences of all others are arrays."""

_NONE: Mapping[str, npt.NDArray[Any]] = {}


def serialize(message: Any, arrays: Mapping[str, npt.NDArray[Any]] = _NONE) -> bytes:
    """Return the CDR bytes of a message, with some of its sequences taken from arrays.

    Args:
        message: any ROS message; the values of the fields in `arrays` are ignored.
        arrays: (N, k) for a sequence of N messages that consist of k numbers of one type, (N,) for
            a sequence of N numbers; the dtype must be the type on the wire.

    Raises:
        AttributeError: the message has no such field.
        MessageError: a text is not valid Unicode, or the type of a field is not supported
            (wstring).
    """
    for name in arrays:
        getattr(message, name)
    writer = _Writer()
    _struct(type(message)).write(writer, message, arrays)
    return writer.joined()


def view(data: Buffer, message_type: MessageType) -> Any:
    """Return an object with the attributes of a message, whose arrays share memory with the bytes.

    Messages in it are such objects, too. Sequences and arrays of numbers are NumPy arrays; those of
    little-endian bytes are not copied, and keep the memory of the bytes alive. Bytes that follow a
    message are ignored: rclpy itself leaves some there.

    Args:
        data: the bytes, little- or big-endian.
        message_type: class of the message; "grid_map_msgs/GridMap" needs no message package.

    Raises:
        MessageError: the bytes end too early, a length or a text is invalid, the encoding is
            not plain CDR, or the type of a field is not supported (wstring). The error names the
            field.
    """
    codec = _struct(message_type)
    try:
        return codec.read(_Reader(data))
    except MessageError as error:
        if error.field:
            raise
        # The numbers of a point are read at once, so that none of them can be named.
        raise _inside(codec.name, error) from None


def serialize_view(view: Any, message_type: MessageType) -> bytes:
    """Return the CDR bytes of an object with the attributes of a message; arrays are copied once.

    Raises:
        MessageError: as for `serialize`.
    """
    writer = _Writer()
    _struct(message_type).write(writer, view)
    return writer.joined()


@dataclass(frozen=True)
class Deferred:
    """A sequence of numbers for `serialize_view` that is written where it belongs in the bytes.

    Args:
        count: number of numbers.
        write: is called with an array (count,) of the type on the wire, and fills it.
    """

    count: int
    write: Callable[[npt.NDArray[Any]], object]

    def __len__(self) -> int:
        return self.count


class _Packing:
    """Consecutive numbers of one size; `codes` are format characters of `struct`."""

    def __init__(self, codes: str) -> None:
        self.alignment = struct.calcsize("<" + codes[0])
        self.size = struct.calcsize("<" + codes)
        self.pack = struct.Struct("<" + codes).pack
        self.unpackers = {order: struct.Struct(order + codes).unpack_from for order in "<>"}


_COUNT = _Packing("I")


class _Writer:
    """Pieces of a message, each aligned to its own size as CDR demands."""

    def __init__(self) -> None:
        # An integer is the length of a gap for deferred values.
        self._pieces: list[bytes | memoryview | int] = [_HEADER]
        self._size = 0
        self._deferred: list[tuple[int, np.dtype[Any], Deferred]] = []

    def joined(self) -> bytes:
        if not self._deferred:
            return b"".join(cast(list[bytes], self._pieces))
        # `bytes` cannot be written into, but the memory of `BytesIO` can be, and becomes bytes
        # without a copy.
        stream = BytesIO()
        stream.seek(len(_HEADER) + self._size - 1)
        stream.write(b"\0")
        stream.seek(0)
        for piece in self._pieces:
            if isinstance(piece, int):
                stream.seek(piece, SEEK_CUR)
            else:
                stream.write(piece)
        with stream.getbuffer() as memory:
            for begin, dtype, deferred in self._deferred:
                deferred.write(np.frombuffer(memory, dtype, len(deferred), begin))
        return stream.getvalue()

    def add(self, data: bytes | memoryview, alignment: int = 1) -> None:
        if padding := -self._size % alignment:
            self._pieces.append(bytes(padding))
        self._pieces.append(data)
        self._size += padding + len(data)

    def count(self, number: int) -> None:
        self.add(_COUNT.pack(number), _COUNT.alignment)

    def defer(self, values: Deferred, dtype: np.dtype[Any]) -> None:
        if values.count:
            self.add(b"", dtype.itemsize)
            self._deferred.append((len(_HEADER) + self._size, dtype, values))
            self._pieces.append(values.count * dtype.itemsize)
            self._size += values.count * dtype.itemsize

    def array(self, values: npt.NDArray[Any]) -> None:
        if values.size:
            contiguous = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
            self.add(contiguous.data.cast("B"), values.itemsize)


class _Reader:
    """Bytes of a message, and the position up to which they are read.

    Attributes:
        order: byte order of numbers, as in `struct`.
    """

    def __init__(self, data: Buffer) -> None:
        buffer = memoryview(data).cast("B")
        self.order = _order(buffer)
        self._data = buffer[len(_HEADER) :]
        self._size = len(self._data)
        self._end = 0

    def take(self, size: int, alignment: int = 1) -> memoryview:
        begin = self._end + -self._end % alignment
        if size > self._size - begin:
            raise self._cut_off(size, begin)
        self._end = begin + size
        return self._data[begin : self._end]

    def numbers(self, packing: "_Packing") -> tuple[Any, ...]:
        begin = self._end + -self._end % packing.alignment
        try:
            values: tuple[Any, ...] = packing.unpackers[self.order](self._data, begin)
        except struct.error:
            raise self._cut_off(packing.size, begin) from None
        self._end = begin + packing.size
        return values

    def count(self, bound: int, smallest: int) -> int:
        """Return the length of a sequence, which must fit its bound and the bytes that remain."""
        number: int = self.numbers(_COUNT)[0]
        if number > bound:
            raise MessageError("", f"at most {bound} values", number)
        remaining = self._size - self._end
        if number * smallest > remaining:
            fitting = f"at most {remaining // smallest} values ({remaining} bytes more)"
            raise MessageError("", fitting, number)
        return number

    def _cut_off(self, size: int, begin: int) -> MessageError:
        return MessageError("", f"{size} bytes more", max(self._size - begin, 0))


class _Codec(Protocol):
    """Reads and writes the values of one type.

    Attributes:
        smallest: bytes that every value takes at least.
    """

    @property
    def smallest(self) -> int: ...

    def read(self, reader: _Reader) -> Any: ...

    def write(self, writer: _Writer, value: Any) -> None: ...


class _Number:
    """A number; `code` is its format character in `struct` and `array`."""

    def __init__(self, code: str) -> None:
        self.code = code
        self.codes = code
        self._packing = _Packing(code)
        self.smallest = self._packing.size

    @property
    def is_object(self) -> bool:
        return self.code in _OBJECTS

    def read(self, reader: _Reader) -> Any:
        return reader.numbers(self._packing)[0]

    def write(self, writer: _Writer, value: Any) -> None:
        writer.add(self._packing.pack(value), self.smallest)

    def build(self, values: Iterator[Any]) -> Any:
        """Return the next of the numbers that were read at once."""
        return next(values)

    def read_array(self, reader: _Reader, count: int) -> npt.NDArray[Any]:
        """Return consecutive numbers in native byte order."""
        if count == 0:
            return np.empty(0, self.code)
        data = reader.take(count * self.smallest, self.smallest)
        values = np.frombuffer(data, np.dtype(reader.order + self.code))
        return values.astype(self.code, copy=False)

    def write_array(self, writer: _Writer, values: Any) -> None:
        if isinstance(values, Deferred):
            writer.defer(values, np.dtype("<" + self.code))
        else:
            writer.array(np.asarray(values, self.code))


@dataclass(frozen=True)
class _Text:
    bound: int
    smallest: int = 4

    def read(self, reader: _Reader) -> str:
        data = bytes(reader.take(reader.count(self.bound + 1, 1)))
        data = data.removesuffix(b"\0")
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


@dataclass(frozen=True)
class _Sequence:
    """Values after their number."""

    item: _Codec
    bound: int
    smallest: int = 4

    def read(self, reader: _Reader) -> Any:
        count = reader.count(self.bound, self.item.smallest)
        return _read_items(self.item, reader, count)

    def write(self, writer: _Writer, value: Any) -> None:
        writer.count(len(value))
        _write_items(self.item, writer, value)


@dataclass(frozen=True)
class _Array:
    """A fixed number of values."""

    item: _Codec
    count: int

    @property
    def smallest(self) -> int:
        return self.count * self.item.smallest

    def read(self, reader: _Reader) -> Any:
        return _read_items(self.item, reader, self.count)

    def write(self, writer: _Writer, value: Any) -> None:
        if len(value) != self.count:
            raise MessageError("", f"{self.count} values", len(value))
        _write_items(self.item, writer, value)


class _Struct:
    """A message.

    Attributes:
        name: name of its type.
        fields: names and codecs of its fields.
        codes: `struct` codes of all its numbers if it consists of numbers of one size, as points
            and poses do; they are read and written at once. Otherwise empty.
        paths: paths of its numbers and texts, such as `position.x`.
    """

    def __init__(self, message_type: Any) -> None:
        if isinstance(message_type, str):
            self.name, types = message_type, FIELDS_BY_TYPE[message_type]
        else:
            self.name, types = message_type.__name__, message_type.get_fields_and_field_types()
        is_known = isinstance(message_type, str)
        self.fields = tuple(
            (name, _codec(kind, f"{self.name}.{name}", is_known=is_known))
            for name, kind in types.items()
        )
        self.codes = _common_codes([codec for _, codec in self.fields])
        self._packing = _Packing(self.codes) if self.codes else None
        self.paths = [
            f"{name}.{path}".rstrip(".")
            for name, codec in self.fields
            for path in getattr(codec, "paths", [""])
        ]
        self._getters = [attrgetter(path) for path in self.paths]
        self._builders = [
            (name, codec.build)
            for name, codec in self.fields
            if isinstance(codec, (_Number, _Struct))
        ]
        # A message without fields takes a byte all the same.
        self.smallest = sum(codec.smallest for _, codec in self.fields) or 1

    def read(self, reader: _Reader) -> Any:
        if self._packing:
            return self.build(iter(reader.numbers(self._packing)))
        if not self.fields:
            reader.take(1)
        values = {}
        for name, codec in self.fields:
            try:
                values[name] = codec.read(reader)
            except MessageError as error:
                raise _inside(name, error) from None
        return SimpleNamespace(**values)

    def write(
        self, writer: _Writer, value: Any, arrays: Mapping[str, npt.NDArray[Any]] = _NONE
    ) -> None:
        """Write the fields of `value`, those in `arrays` from there."""
        if self._packing:
            values = [get(value) for get in self._getters]
            writer.add(self._packing.pack(*values), self._packing.alignment)
            return
        if not self.fields:
            writer.add(b"\0")
        for name, codec in self.fields:
            if name in arrays:
                writer.count(len(arrays[name]))
                writer.array(arrays[name])
            else:
                _write(codec, writer, getattr(value, name), name)

    def build(self, values: Iterator[Any]) -> Any:
        """Return the message made of the next of the numbers that were read at once."""
        return SimpleNamespace(**{name: build(values) for name, build in self._builders})


def _common_codes(codecs: Sequence[_Codec]) -> str:
    """Return the codes of all numbers if there are no other values and all have one size."""
    codes = [getattr(codec, "codes", "") for codec in codecs]
    sizes = {struct.calcsize("<" + code) for code in "".join(codes)}
    return "".join(codes) if all(codes) and len(sizes) == 1 else ""


def _struct(message_type: MessageType) -> _Struct:
    if message_type not in _STRUCTS:
        _STRUCTS[message_type] = _Struct(message_type)
    return _STRUCTS[message_type]


_STRUCTS: dict[MessageType, _Struct] = {}


def _codec(kind: str, field: str, *, is_known: bool) -> _Codec:
    """Return the codec of a type; `is_known` takes nested messages from `FIELDS_BY_TYPE`."""
    if kind in _CODES:
        return _Number(_CODES[kind])
    match = _TYPE.fullmatch(kind)
    if match is None:
        raise MessageError(field, "a type that can be serialized", kind)
    if items := match["items"]:
        bound = int(match["bound"] or sys.maxsize)
        return _Sequence(_codec(items, field, is_known=is_known), bound)
    if item := match["item"]:
        return _Array(_codec(item, field, is_known=is_known), int(match["count"]))
    if name := match["name"]:
        return _struct(kind if is_known else getattr(messages_of(match["package"]), name))
    return _Text(int(match["length"] or sys.maxsize))


def _order(buffer: memoryview) -> str:
    """Return the byte order from the header of a message."""
    if len(buffer) < len(_HEADER):
        raise MessageError("encoding", f"{len(_HEADER)} bytes", len(buffer))
    number = int.from_bytes(buffer[:2])
    if number not in _ORDERS:
        found = f"{_OTHER_ENCODINGS.get(number, 'unknown')} (0x{number:04x})"
        raise MessageError("encoding", "plain CDR (0x0000 or 0x0001)", found)
    return _ORDERS[number]


def _is_numeric(item: _Codec) -> TypeGuard[_Number]:
    return isinstance(item, _Number) and not item.is_object


def _read_items(item: _Codec, reader: _Reader, count: int) -> Any:
    if _is_numeric(item):
        return item.read_array(reader, count)
    items = []
    for index in range(count):
        try:
            items.append(item.read(reader))
        except MessageError as error:
            raise _inside(f"[{index}]", error) from None
    return items


def _write_items(item: _Codec, writer: _Writer, items: Any) -> None:
    if _is_numeric(item):
        item.write_array(writer, items)
        return
    for index, value in enumerate(items):
        _write(item, writer, value, f"[{index}]")


def _write(codec: _Codec, writer: _Writer, value: Any, name: str) -> None:
    try:
        codec.write(writer, value)
    except MessageError as error:
        raise _inside(name, error) from None


def _inside(name: str, error: MessageError) -> MessageError:
    """Return the error of a field with the path of its message or sequence."""
    separator = "." if error.field and not error.field.startswith("[") else ""
    return MessageError(f"{name}{separator}{error.field}", error.expected, error.found)
