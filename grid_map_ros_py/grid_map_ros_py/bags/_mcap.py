# SPDX-License-Identifier: BSD-3-Clause
"""Reader and writer of MCAP bag files (format specification: https://mcap.dev/spec)."""

import io
import os
import struct
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from grid_map_core_py.errors import LimitError, required
from grid_map_core_py.limits import check_bytes

from ..errors import BagError
from ._storage import Entry, Topic, dump

MAGIC = b"\x89MCAP0\r\n"

COMPRESSIONS = ("none", "lz4", "zstd")

_HINT = "recover=True (--recover) reads up to the last whole chunk; 'mcap recover' repairs the file"

_CHUNK_SIZE = 768 * 1024
"""Size at which a chunk is written to the file [bytes], the default of rosbag2."""

_RESERVE = 2**20
"""Space reserved for message types, the header of the last chunk, and metadata [bytes]."""

_RESERVE_PER_MESSAGE = 256
"""Space reserved for the header and index entries of one message [bytes]."""

_RECORD = struct.Struct("<BQ")
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = range(1, 9)
_STATISTICS, _METADATA, _METADATA_INDEX, _DATA_END = 11, 12, 13, 15
_LENGTH = struct.Struct("<I")
_KEY = struct.Struct("<H")
_CHANNEL_HEAD = struct.Struct("<HH")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ENTRY = struct.Struct("<QQ")
_CHUNK_INDEX_HEAD = struct.Struct("<QQQQ")
_STATISTICS_HEAD = struct.Struct("<QHIIIIQQ")
_COUNT = struct.Struct("<HQ")
_FOOTER_HEAD = struct.Struct("<QQ")
_FOOTER_SIZE = _RECORD.size + _FOOTER_HEAD.size + 4 + len(MAGIC)


def package(module: str, feature: str) -> Any:
    """Import a package that compresses data."""
    return required(module, feature)


class _Channel(NamedTuple):
    """Topic of messages, with the key of its message type."""

    topic: str
    schema: int
    encoding: str
    qos: str


# --- reading --------------------------------------------------------------------------------------


class McapFile:
    """An MCAP file, open for reading.

    The reader finds messages through the file index, or scans the file if the index is missing or
    incomplete. The `place` of an entry is (file offset of the chunk, offset of the message in the
    decompressed chunk), or (-1, file offset of the message) for a message outside chunks.

    If `recover` is true, the reader ignores the index and reads up to the first damaged record,
    with a warning.
    """

    def __init__(self, path: Path, *, recover: bool = False) -> None:
        self._path = path
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, _Channel] = {}
        self._chunks: list[tuple[int, dict[int, int]]] = []
        self._counts: dict[int, int] = {}
        self._scanned: list[tuple[int, Entry]] | None = None
        self._chunk: tuple[int, BinaryIO] | None = None
        self._size = path.stat().st_size
        self._file = path.open("rb")
        try:
            if recover:
                self._scan(recover=True)
                return
            self._file.seek(max(self._size - len(MAGIC), 0))
            if self._size <= len(MAGIC) or self._file.read() != MAGIC:
                reason = "is cut off: the recording was interrupted or the copy is not complete"
                raise BagError(self._path, f"{reason}; {_HINT}")
            if not self._read_summary():
                self._scan()
        except BaseException:
            self.close()
            raise

    @property
    def topics(self) -> dict[str, Topic]:
        """Type and encoding of each topic, by topic name."""
        return {
            channel.topic: Topic(
                self._schemas.get(channel.schema, ""), channel.encoding, channel.qos
            )
            for channel in self._channels.values()
        }

    def entries(self, topics: Collection[str]) -> list[tuple[Entry, str]]:
        """Return (entry, topic) of each message on `topics`, in time order."""
        names = {
            key: channel.topic for key, channel in self._channels.items() if channel.topic in topics
        }
        found = self._scanned
        if found is None:
            found = []
            for chunk, offsets in self._chunks:
                for channel, offset in offsets.items():
                    if channel in names:
                        self._seek(self._file, offset, _MESSAGE_INDEX)
                        _, size = _INDEX_HEAD.unpack(self._file.read(_INDEX_HEAD.size))
                        for time, place in _INDEX_ENTRY.iter_unpack(self._file.read(size)):
                            found.append((channel, Entry(time, (chunk, place))))
            counts = Counter(channel for channel, _ in found)
            if any(counts[key] != self._counts.get(key, 0) for key in names):
                # The index is incomplete.
                found = self._scan()
        # Messages with equal times keep their order in the file.
        return sorted((entry, names[key]) for key, entry in found if key in names)

    def read(self, entry: Entry) -> bytes:
        """Return the serialized message of an entry."""
        chunk, offset = entry.place
        stream = self._file if chunk < 0 else self._unpacked(chunk)
        length = self._seek(stream, offset, _MESSAGE)
        if _MESSAGE_HEAD.unpack(stream.read(_MESSAGE_HEAD.size))[2] != entry.time:
            raise BagError(self._path, f"its index is damaged: another time at {entry.place}")
        return stream.read(length - _MESSAGE_HEAD.size)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _read_summary(self) -> bool:
        """Read topics, chunk index and message counts; return whether the file contains them."""
        end = self._size - _FOOTER_SIZE
        if end < len(MAGIC):
            return False
        self._seek(self._file, end, _FOOTER)
        (start, _) = _FOOTER_HEAD.unpack(self._file.read(_FOOTER_HEAD.size))
        if not start:
            return False
        has_statistics = False
        for code, _, length in self._records(self._file, start, end):
            if code == _CHUNK_INDEX:
                data = io.BytesIO(self._file.read(length))
                chunk = _CHUNK_INDEX_HEAD.unpack(data.read(_CHUNK_INDEX_HEAD.size))[2]
                self._chunks.append((chunk, _read_counts(data)))
            elif code == _STATISTICS:
                data = io.BytesIO(self._file.read(length))
                data.seek(_STATISTICS_HEAD.size)
                self._counts, has_statistics = _read_counts(data), True
            else:
                self._read_topic(self._file, code, length)
        return has_statistics and bool(self._schemas and self._channels)

    def _read_topic(self, stream: BinaryIO, code: int, length: int) -> None:
        """Read a record if it describes a message type or a topic."""
        if code not in (_SCHEMA, _CHANNEL):
            return
        data = io.BytesIO(stream.read(length))
        if code == _SCHEMA:
            (key,) = _KEY.unpack(data.read(_KEY.size))
            self._schemas[key] = _read_text(data)
        else:
            key, schema = _CHANNEL_HEAD.unpack(data.read(_CHANNEL_HEAD.size))
            topic, encoding = _read_text(data), _read_text(data)
            (size,) = _LENGTH.unpack(data.read(_LENGTH.size))
            end, metadata = data.tell() + size, dict[str, str]()
            while data.tell() < end:
                name = _read_text(data)
                metadata[name] = _read_text(data)
            qos = metadata.get("offered_qos_profiles", "")
            self._channels[key] = _Channel(topic, schema, encoding, qos)

    def _records(self, stream: BinaryIO, start: int, end: int) -> Iterator[tuple[int, int, int]]:
        """Yield (code, offset, content length) of each record; the stream is at the content."""
        while start < end:
            stream.seek(start)
            code, length = _RECORD.unpack(stream.read(_RECORD.size).ljust(_RECORD.size, b"\0"))
            after = start + _RECORD.size + length
            if code == 0 or after > end:
                raise BagError(self._path, f"is damaged: no whole record at {start}; {_HINT}")
            yield code, start, length
            start = after

    def _scan(self, *, recover: bool = False) -> list[tuple[int, Entry]]:
        """Scan the file for messages and return (channel, entry) of each."""
        self._scanned = []
        try:
            self._scan_records(self._file, len(MAGIC), self._size)
        # The decompression packages may raise any exception if data is damaged.
        except Exception as error:
            if not recover or isinstance(error, LimitError):
                raise
            text = "is damaged and read up to the last whole chunk; 'mcap recover' may save more"
            warnings.warn(f"{self._path}: {text}", stacklevel=2)
        return self._scanned

    def _scan_records(self, stream: BinaryIO, start: int, end: int, chunk: int = -1) -> None:
        assert self._scanned is not None
        for code, place, length in self._records(stream, start, end):
            if code == _DATA_END:
                return
            if code == _MESSAGE:
                channel, _, time, _ = _MESSAGE_HEAD.unpack(stream.read(_MESSAGE_HEAD.size))
                self._scanned.append((channel, Entry(time, (chunk, place))))
            elif code == _CHUNK:
                content = self._unpacked(place)
                self._scan_records(content, 0, content.seek(0, os.SEEK_END), place)
            else:
                self._read_topic(stream, code, length)

    def _seek(self, stream: BinaryIO, offset: int, code: int) -> int:
        """Move the stream to the content of the record at `offset`; return the content length."""
        stream.seek(offset)
        found, length = _RECORD.unpack(stream.read(_RECORD.size))
        if found != code:
            raise BagError(self._path, f"its index is damaged: no record {code} at {offset}")
        return int(length)

    def _unpacked(self, offset: int) -> BinaryIO:
        """Return a stream of the decompressed chunk at `offset`; the last chunk is cached."""
        if self._chunk is None or self._chunk[0] != offset:
            self._seek(self._file, offset, _CHUNK)
            _, _, size, checksum = _CHUNK_HEAD.unpack(self._file.read(_CHUNK_HEAD.size))
            compression = _read_text(self._file)
            packed_size = int.from_bytes(self._file.read(8), "little")
            data = self._file.read(min(packed_size, self._size))
            if compression:
                check_bytes(f"{self._path}: a chunk", size, packed_size)
            if compression == "lz4":
                data = package("lz4.frame", f"the bag {self._path}").decompress(data)
            elif compression == "zstd":
                data = package("zstandard", f"the bag {self._path}").decompress(data, size)
            elif compression:
                raise BagError(self._path, f"its compression {compression!r} is not known")
            if len(data) != size or (checksum and zlib.crc32(data) != checksum):
                raise BagError(self._path, f"is damaged: a wrong chunk at {offset}; {_HINT}")
            self._chunk = offset, io.BytesIO(data)
        return self._chunk[1]


def _read_text(stream: BinaryIO) -> str:
    """Read a string and its length."""
    (length,) = _LENGTH.unpack(stream.read(_LENGTH.size))
    data = stream.read(length)
    if len(data) != length:
        raise ValueError(f"a text of {length} bytes ends after {len(data)}")
    return data.decode()


def _read_counts(stream: BinaryIO) -> dict[int, int]:
    """Read a table of numbers by channel."""
    (size,) = _LENGTH.unpack(stream.read(_LENGTH.size))
    return dict(_COUNT.iter_unpack(stream.read(size)))


# --- writing --------------------------------------------------------------------------------------


class McapWriter:
    """Writes serialized messages to a new MCAP file.

    If `reserve` is true, the writer allocates disk space before each message, so that the file can
    be completed even if the disk fills up.
    """

    def __init__(self, path: Path, compression: str = "none", *, reserve: bool = False) -> None:
        self._compression = "" if compression == "none" else compression
        self._compress = _compressor(compression)
        self._file = path.open("xb")
        self._reserves = reserve
        self._reserved = self._written = self._waiting = 0
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts = Counter[int]()
        self._spans: list[tuple[int, int]] = []  # first and last time in each chunk [ns]
        # Records of the summary, by kind.
        self._summary = {code: bytearray() for code in (_SCHEMA, _CHANNEL, _CHUNK_INDEX)}
        self._start_chunk()
        self._file.write(MAGIC)
        self._file.write(_record(_HEADER, _text("ros2") + _text("grid_map_ros_py")))

    def write(self, topic: str, kind: Topic, time: int, data: bytes) -> None:
        """Append a serialized message with its time [ns]."""
        if self._reserves:
            written = self._file.tell()
            if written != self._written:
                self._written, self._waiting = written, 0
            self._waiting += len(data) + _RESERVE_PER_MESSAGE
            # The chunk index is smaller than 1/1024 of the chunks.
            needed = written + written // 1024 + self._waiting + _RESERVE
            if needed > self._reserved:
                os.posix_fallocate(self._file.fileno(), self._reserved, needed - self._reserved)
                self._reserved = needed
        key = self._channels.get(topic) or self._new_channel(topic, kind)
        head = _MESSAGE_HEAD.pack(key, 0, time, time)
        self._index.setdefault(key, []).append((time, self._size))
        self._add(_RECORD.pack(_MESSAGE, len(head) + len(data)), head, data)
        if self._size > _CHUNK_SIZE:
            self._write_chunk()

    def finish(self, information: object) -> None:
        """Write the bag metadata and the index, then close the file."""
        self._write_chunk()
        place, name = self._file.tell(), _text("rosbag2")
        pairs = _text("serialized_metadata") + _text(dump(information))
        metadata = _record(_METADATA, name + _sized(pairs))
        self._file.write(metadata + _record(_DATA_END, bytes(4)))
        start = self._file.tell()
        statistics = _STATISTICS_HEAD.pack(
            self._counts.total(),
            *(len(self._schemas), len(self._channels), 0, 1, len(self._spans)),
            *(min(self._spans)[0], max(end for _, end in self._spans)),
        )
        summary = b"".join(
            (
                self._summary[_SCHEMA],
                self._summary[_CHANNEL],
                _record(_STATISTICS, statistics + _counts(self._counts)),
                self._summary[_CHUNK_INDEX],
                _record(_METADATA_INDEX, _INDEX_ENTRY.pack(place, len(metadata)) + name),
                _RECORD.pack(_FOOTER, _FOOTER_HEAD.size + 4),
                _FOOTER_HEAD.pack(start, 0),
            )
        )
        self._file.write(summary + _LENGTH.pack(zlib.crc32(summary)) + MAGIC)
        self._file.truncate()
        self._file.close()

    def close(self) -> None:
        """Close the file, which is valid only if `finish` was called first."""
        with suppress(OSError):
            self._file.close()

    def _new_channel(self, topic: str, kind: Topic) -> int:
        """Describe a topic, and its message type if that is new; return the key of the topic."""
        if kind.type not in self._schemas:
            schema = self._schemas[kind.type] = len(self._schemas) + 1
            texts = (kind.type, "ros2msg" if kind.definition else "", kind.definition)
            self._describe(_SCHEMA, _KEY.pack(schema) + b"".join(map(_text, texts)))
        key = self._channels[topic] = len(self._channels) + 1
        metadata = ("offered_qos_profiles", kind.qos, "topic_type_hash", kind.type_hash)
        self._describe(
            _CHANNEL,
            _CHANNEL_HEAD.pack(key, self._schemas[kind.type])
            + b"".join(map(_text, (topic, kind.encoding)))
            + _sized(b"".join(map(_text, metadata))),
        )
        return key

    def _describe(self, code: int, content: bytes) -> None:
        record = _record(code, content)
        self._summary[code] += record
        self._add(record)

    def _start_chunk(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._index: dict[int, list[tuple[int, int]]] = {}

    def _add(self, *parts: bytes) -> None:
        self._parts += parts
        self._size += sum(map(len, parts))

    def _write_chunk(self) -> None:
        """Write the collected records as a chunk, followed by the index of its messages."""
        if not self._index:
            return
        checksum = 0
        for part in self._parts:
            checksum = zlib.crc32(part, checksum)
        times = [time for entries in self._index.values() for time, _ in entries]
        span = (min(times), max(times))
        parts = self._compress(self._parts)
        packed_size, compression = sum(map(len, parts)), _text(self._compression)
        head = _CHUNK_HEAD.pack(*span, self._size, checksum) + compression
        start = self._file.tell()
        self._file.write(_RECORD.pack(_CHUNK, len(head) + 8 + packed_size))
        self._file.write(head + packed_size.to_bytes(8, "little"))
        self._file.writelines(parts)
        end, offsets = self._file.tell(), dict[int, int]()
        for key, entries in self._index.items():
            offsets[key] = self._file.tell()
            packed = b"".join(_INDEX_ENTRY.pack(*entry) for entry in entries)
            self._file.write(_record(_MESSAGE_INDEX, _KEY.pack(key) + _sized(packed)))
            self._counts[key] += len(entries)
        self._spans.append(span)
        self._summary[_CHUNK_INDEX] += _record(
            _CHUNK_INDEX,
            _CHUNK_INDEX_HEAD.pack(*span, start, end - start)
            + _counts(offsets)
            + (self._file.tell() - end).to_bytes(8, "little")
            + compression
            + _INDEX_ENTRY.pack(packed_size, self._size),
        )
        self._start_chunk()


def _compressor(name: str) -> Callable[[list[bytes]], list[bytes]]:
    """Return the function that compresses the parts of a chunk."""
    if name == "none":
        return lambda parts: parts
    module = package({"lz4": "lz4.frame", "zstd": "zstandard"}[name], f"compression {name!r}")
    return lambda parts: [module.compress(b"".join(parts))]


def _record(code: int, content: bytes) -> bytes:
    return _RECORD.pack(code, len(content)) + content


def _sized(content: bytes) -> bytes:
    return _LENGTH.pack(len(content)) + content


def _text(text: str) -> bytes:
    return _sized(text.encode())


def _counts(numbers: Mapping[int, int]) -> bytes:
    """Serialize a table of numbers by channel."""
    return _sized(b"".join(_COUNT.pack(*item) for item in numbers.items()))
