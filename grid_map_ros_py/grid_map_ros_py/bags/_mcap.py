# SPDX-License-Identifier: BSD-3-Clause
"""The MCAP files of bags; the package `mcap` knows the records.

Reading follows the index of the file where there is one, and otherwise scans the file. Lengths are
checked against the size of the file, and checksums are verified.
"""

import io
import os
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any

from grid_map_core_py.errors import LimitError, required
from grid_map_core_py.limits import check_bytes, check_ratio

from ..errors import BagError
from ._storage import CutOffError, Entry, Topic, check_entries, dump, most_entries

MAGIC = b"\x89MCAP0\r\n"

COMPRESSIONS = ("none", "lz4", "zstd")

_CUT_OFF = (
    "is cut off: the recording was interrupted or the copy is not complete; recover=True, or "
    "'grid-map convert --recover', reads what is in it, and so do 'ros2 bag reindex' followed by "
    "'ros2 bag convert', and 'mcap recover'"
)

_CHUNK_SIZE = 768 * 1024
"""Size [bytes] at which a chunk is written, the same as in rosbag2."""

_RESERVE = 2**20
"""Bytes allocated beyond the messages, for their types, the last chunk's head, and metadata."""

_RESERVE_PER_MESSAGE = 256
"""Bytes of a message's head and its entries in the indexes."""

_CHUNKS_PER_INDEX = 1024
"""Bytes of chunks for each byte of their index at the end of the file."""

_INDEX_ENTRY = 16
"""Bytes of a message's entry in the index of its chunk."""

_RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")

_FOOTER_CODE, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX = range(2, 9)
_STATISTICS, _DATA_END = 11, 15
_RECORDS = {
    _SCHEMA: "Schema",
    _CHANNEL: "Channel",
    _MESSAGE_INDEX: "MessageIndex",
    _CHUNK_INDEX: "ChunkIndex",
    _STATISTICS: "Statistics",
}
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<16xQII")
_SIZE = struct.Struct("<Q")


def package(module: str, path: Path) -> Any:
    """Return a module of the package `mcap` or of those that it needs."""
    return required(module, f"the bag {path}", "pip install mcap")


# --- reading --------------------------------------------------------------------------------------


class McapFile:
    """A file that is open for reading.

    Args:
        path: the file.
        recover: read what is there of a damaged file, without its index.

    Attributes:
        lost: bytes that cannot be read.
    """

    def __init__(self, path: Path, *, recover: bool = False) -> None:
        self._path = path
        self._recover = recover
        self.lost = 0
        self._records = package("mcap.records", path)
        self._streams = package("mcap.data_stream", path)
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        self._chunks: list[Any] = []
        self._scanned: list[tuple[int, Entry]] | None = None
        self._chunk: tuple[int, _Source] | None = None
        self._last: tuple[int, _Source] | None = None
        self._file = path.open("rb")
        self._source = _Source(self._read_file, path.stat().st_size)
        self._most_entries = most_entries(self._source.size)
        try:
            self._scan() if recover else self._read_summary()
        except BaseException:
            self.close()
            raise

    @property
    def topics(self) -> dict[str, Topic]:
        """Types and encodings by the names of the topics."""
        topics = {}
        for channel in self._channels.values():
            schema = self._schemas.get(channel.schema_id)
            topics[channel.topic] = Topic(
                schema.name if schema else "",
                channel.message_encoding,
                channel.metadata.get("offered_qos_profiles", ""),
            )
        return topics

    def entries(self, topics: Collection[str]) -> list[tuple[Entry, str]]:
        """Return times and places of the messages on topics, in time order, with their topics."""
        names = {
            key: channel.topic for key, channel in self._channels.items() if channel.topic in topics
        }
        # Messages with equal times keep the order of the file.
        return sorted((entry, names[key]) for key, entry in self._entries_of(names))

    def read(self, entry: Entry) -> bytes:
        """Return a message as it was recorded."""
        chunk, offset = entry.place
        source = self._source if chunk < 0 else self._unpacked(chunk)
        code, body = source.record_at(offset)
        if code != _MESSAGE or len(body) < _MESSAGE_HEAD.size:
            raise BagError(self._path, f"its index is damaged: no message at {entry.place}")
        if _MESSAGE_HEAD.unpack_from(body)[2] != entry.time:
            raise BagError(self._path, f"its index is damaged: another time at {entry.place}")
        return bytes(body[_MESSAGE_HEAD.size :])

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _read_file(self, offset: int, length: int) -> memoryview:
        self._file.seek(offset)
        return memoryview(self._file.read(length))

    def _read_summary(self) -> None:
        """Read schemas, channels and the places of chunks; scan the file if they are missing."""
        end = self._source.size - _FOOTER.size - len(MAGIC)
        if end <= 0 or self._source.at(end + _FOOTER.size, len(MAGIC)) != MAGIC:
            raise CutOffError(self._path, _CUT_OFF)
        code, size, start, _, checksum = _FOOTER.unpack(self._source.at(end, _FOOTER.size))
        if (code, size) != (_FOOTER_CODE, _FOOTER.size - _RECORD.size) or not 0 <= start <= end:
            raise BagError(self._path, "its footer is damaged")
        if start and checksum:
            # Everything except the checksum itself.
            summary = self._source.at(start, end + _FOOTER.size - 4 - start)
            self._check_sum(summary, checksum, "summary")
        self._counts: dict[int, int] | None = None
        for _, code, body in self._source.records(start, end) if start else ():
            record = self._parsed(code, body)
            if code == _CHUNK_INDEX:
                self._chunks.append(record)
            elif code == _STATISTICS:
                self._counts = dict(record.channel_message_counts)
        if not (self._channels and self._schemas and self._chunks and self._counts is not None):
            self._scan()

    # Places of messages: (offset of the chunk in the file or -1, offset in the chunk)

    def _entries_of(self, channels: Collection[int]) -> list[tuple[int, Entry]]:
        """Return the messages of channels, each with its channel."""
        if self._scanned is None:
            assert self._counts is not None
            found = self._indexed(channels)
            counts = Counter(channel for channel, _ in found)
            if all(counts[channel] == self._counts.get(channel, 0) for channel in channels):
                return found
            # The index is not complete.
            self._scan()
        assert self._scanned is not None
        return [one for one in self._scanned if one[0] in channels]

    def _indexed(self, channels: Collection[int]) -> list[tuple[int, Entry]]:
        """Return the messages of channels, as far as the index of the file has them."""
        places = [
            (channel, offset, chunk.chunk_start_offset)
            for chunk in self._chunks
            for channel, offset in chunk.message_index_offsets.items()
            if channel in channels
        ]
        found = list[tuple[int, Entry]]()
        # Indexes that chunks share, or that overlap, would have more messages than memory can hold.
        if len({offset for _, offset, _ in places}) < len(places):
            return []
        for channel, offset, chunk in places:
            index = self._parsed(*self._source.record_at(offset))
            if getattr(index, "channel_id", None) != channel:
                raise BagError(self._path, f"its index is damaged: none of channel {channel} there")
            found += [(channel, Entry(time, (chunk, place))) for time, place in index.records]
            if len(found) * _INDEX_ENTRY > self._source.size:
                return []
        return found

    def _scan(self) -> None:
        """Find all messages without an index."""
        self._scanned = []
        self._scanned_size = 0
        done, size = len(MAGIC), self._source.size
        try:
            for offset, code, body in self._source.records(
                done, size if self._recover else size - len(MAGIC)
            ):
                if code == _DATA_END:
                    return
                if code == 0:
                    raise ValueError(f"no record at {offset}")
                if code == _CHUNK:
                    self._scan_chunk(offset, body)
                else:
                    self._note(code, body, (-1, offset))
                done = offset + _RECORD.size + len(body)
        except (ValueError, struct.error) as error:
            if not self._recover or isinstance(error, LimitError):
                raise
            self._scan_end(done)

    def _scan_end(self, offset: int) -> None:
        """Find the messages in a chunk that the end of the file has cut off."""
        rest = self._source.at(offset, self._source.size - offset)
        if rest[:1] == bytes([_CHUNK]) and len(rest) > _RECORD.size + _CHUNK_HEAD.size:
            self._scan_chunk(offset, rest[_RECORD.size :])
        else:
            # Zeros are space that the recorder had allocated.
            self.lost += len(bytes(rest).rstrip(b"\0"))

    def _scan_chunk(self, offset: int, body: memoryview) -> None:
        # Depending on the damage, the packages that unpack raise any kind of exception.
        try:
            source = self._unpack(body)
        except Exception:
            if not self._recover:
                raise
            self.lost += len(body)
            return
        self._scanned_size += source.size
        check_ratio(f"{self._path}: its chunks", self._scanned_size, self._source.size)
        end = 0
        try:
            for inside, code, content in source.records(0, source.size):
                self._note(code, content, (offset, inside))
                end = inside + _RECORD.size + len(content)
        except Exception as error:
            if not self._recover or isinstance(error, LimitError):
                raise
            self.lost += source.size - end
        if self._recover:
            self._last = offset, source

    def _note(self, code: int, body: memoryview, place: tuple[int, int]) -> None:
        assert self._scanned is not None
        if code == _MESSAGE:
            channel, _, time, _ = _MESSAGE_HEAD.unpack_from(body)
            self._scanned.append((channel, Entry(time, place)))
            if len(self._scanned) > self._most_entries:
                check_entries(self._path, len(self._scanned), self._source.size)
        elif code in (_SCHEMA, _CHANNEL):
            self._parsed(code, body)

    # Records and chunks

    def _parsed(self, code: int, body: memoryview) -> Any:
        """Return a record, and keep it if it is a schema or a channel; None for another kind."""
        if code not in _RECORDS:
            return None
        stream = self._streams.ReadDataStream(io.BytesIO(body))
        record = getattr(self._records, _RECORDS[code]).read(stream)
        if code in (_SCHEMA, _CHANNEL):
            (self._schemas if code == _SCHEMA else self._channels)[record.id] = record
        return record

    def _unpacked(self, offset: int) -> "_Source":
        """Return the content of the chunk at an offset; the last chunk is cached."""
        if self._last is not None and self._last[0] == offset:
            return self._last[1]
        if self._chunk is None or self._chunk[0] != offset:
            code, body = self._source.record_at(offset)
            if code != _CHUNK:
                raise BagError(self._path, f"its index is damaged: no chunk at {offset}")
            self._chunk = offset, self._unpack(body)
        return self._chunk[1]

    def _unpack(self, body: memoryview) -> "_Source":
        """Return the records in a chunk, without a copy where they are not compressed."""
        size, checksum, length = _CHUNK_HEAD.unpack_from(body)
        begin = _CHUNK_HEAD.size + length
        compression = bytes(body[_CHUNK_HEAD.size : begin]).decode()
        if compression not in ("", "lz4", "zstd"):
            raise BagError(self._path, f"its compression {compression!r} is not known")
        (packed_size,) = _SIZE.unpack_from(body, begin)
        data = body[begin + _SIZE.size :][:packed_size]
        if compression:
            check_bytes(f"{self._path}: a chunk", size, len(data))
            data = memoryview(unpack(compression, data, size, self._path, recover=self._recover))
        if len(data) != size and not (self._recover and len(data) < size):
            raise BagError(self._path, f"a chunk of {size} bytes holds {len(data)}")
        if checksum and len(data) == size:
            self._check_sum(data, checksum, "chunk")
        return _Source(lambda offset, length: data[offset : offset + length], len(data))

    def _check_sum(self, data: memoryview, checksum: int, what: str) -> None:
        if zlib.crc32(data) != checksum:
            hint = "recover=True (--recover) reads the rest"
            raise BagError(self._path, f"is damaged: the checksum of a {what} is wrong; {hint}")


def unpack(
    compression: str, data: memoryview, size: int, path: Path, *, recover: bool = False
) -> bytes:
    """Return decompressed data, at most one byte more than `size`.

    Memory grows with the decompressed data, not with the size in its header. With `recover` the
    compressed data may be cut off.
    """
    if compression == "lz4":
        stream = package("lz4.frame", path).open(io.BytesIO(data))
    else:
        stream = package("zstandard", path).ZstdDecompressor().stream_reader(data)
    with stream:
        pieces, room = [], size + 1
        with suppress(EOFError) if recover else nullcontext():
            # A read that meets the end of cut off data returns nothing of what it has unpacked.
            while room > 0 and (piece := stream.read(min(room, 2**10 if recover else 2**20))):
                pieces.append(piece)
                room -= len(piece)
        return b"".join(pieces)


class _Source:
    """A file or a chunk.

    Args:
        read: returns the bytes at an offset, up to a number of them.
        size: number of bytes.
    """

    def __init__(self, read: Callable[[int, int], memoryview], size: int) -> None:
        self.size = size
        self._read = read

    def at(self, offset: int, length: int) -> memoryview:
        """Return bytes; the end of the source in them is an error."""
        if not 0 <= offset <= self.size or length > self.size - offset:
            raise ValueError(f"{length} bytes are missing at {offset}")
        data = self._read(offset, length)
        if len(data) != length:
            raise ValueError(f"is cut off at {offset}")
        return data

    def record_at(self, offset: int) -> tuple[int, memoryview]:
        """Return code and content of the record at an offset."""
        code, length = _RECORD.unpack(self.at(offset, _RECORD.size))
        return code, self.at(offset + _RECORD.size, length)

    def records(self, start: int, end: int) -> Iterator[tuple[int, int, memoryview]]:
        """Yield offset, code and content of the records in a part of the source."""
        while start < end:
            code, body = self.record_at(start)
            yield start, code, body
            start += _RECORD.size + len(body)


# --- writing --------------------------------------------------------------------------------------


class McapWriter:
    """Writes serialized messages to a new file.

    Args:
        path: the file.
        compression: one of `COMPRESSIONS`.
        reserve: whether to allocate space before each message, so that the file can still be
            finished when the disk is full.
    """

    def __init__(self, path: Path, compression: str = "none", *, reserve: bool = False) -> None:
        writer = package("mcap.writer", path)
        kind = writer.CompressionType[compression.upper()]
        self._file = path.open("xb")
        self._reserves = reserve
        self._reserved = self._flushed = self._waiting = 0
        self._writer = writer.Writer(self._file, chunk_size=_CHUNK_SIZE, compression=kind)
        self._writer.start(profile="ros2", library="grid_map_ros_py")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def write(self, topic: str, kind: Topic, time: int, data: bytes) -> None:
        """Append a message."""
        if self._reserves:
            self._reserve(len(data))
        if topic not in self._channels:
            self._add(topic, kind)
        self._writer.add_message(self._channels[topic], time, data, time)

    def _add(self, topic: str, kind: Topic) -> None:
        if kind.type not in self._schemas:
            encoding = "ros2msg" if kind.definition else ""
            self._schemas[kind.type] = self._writer.register_schema(
                kind.type, encoding, kind.definition.encode()
            )
        metadata = {"offered_qos_profiles": kind.qos, "topic_type_hash": kind.type_hash}
        self._channels[topic] = self._writer.register_channel(
            topic, kind.encoding, self._schemas[kind.type], metadata
        )

    def _reserve(self, size: int) -> None:
        """Allocate space for a message, for what is not written yet, and for the index.

        Raises:
            OSError: the disk is full; nothing is lost.
        """
        if self._file.tell() != self._flushed:
            self._flushed, self._waiting = self._file.tell(), 0
        self._waiting += size + _RESERVE_PER_MESSAGE
        needed = self._flushed + self._waiting + _RESERVE + self._flushed // _CHUNKS_PER_INDEX
        if needed > self._reserved:
            os.posix_fallocate(self._file.fileno(), self._reserved, needed - self._reserved)
            self._reserved = needed

    def finish(self, information: object) -> None:
        """Write the metadata of the bag and the index, and close the file."""
        self._writer.add_metadata("rosbag2", {"serialized_metadata": dump(information)})
        self._writer.finish()
        self._file.truncate()
        self._file.close()

    def close(self) -> None:
        """Close the file, which is no bag unless it is finished."""
        with suppress(OSError):
            self._file.close()
