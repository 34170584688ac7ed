# SPDX-License-Identifier: BSD-3-Clause
"""Reader and writer of MCAP bag files, based on the package `mcap`."""

import io
import os
import struct
import warnings
import zlib
from collections import Counter
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

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
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _MESSAGE_INDEX = range(3, 8)
_DATA_END = 15
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_CHUNK_HEAD = struct.Struct("<16xQII")
_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ENTRY = struct.Struct("<QQ")


def package(module: str, path: Path) -> Any:
    """Import a module of the package `mcap` or of one of its dependencies."""
    return required(module, f"the bag {path}")


# --- reading --------------------------------------------------------------------------------------


class McapFile:
    """An MCAP file, open for reading.

    If the index of the file is missing or incomplete, the reader scans the whole file. If `recover`
    is true, the reader scans up to the first damaged record and issues a warning.

    `Entry.place` is (file offset of the chunk, offset of the message in the decompressed chunk).
    For a message outside chunks, it is (-1, file offset of the message).
    """

    def __init__(self, path: Path, *, recover: bool = False) -> None:
        self._path = path
        self._schemas: dict[int, Any] = {}
        self._channels: dict[int, Any] = {}
        self._chunks: list[Any] = []
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
            self._file.seek(0)
            summary = package("mcap.reader", path).SeekingReader(self._file).get_summary()
            if summary and summary.schemas and summary.channels and summary.statistics:
                self._schemas, self._channels = summary.schemas, summary.channels
                self._chunks = summary.chunk_indexes
                self._counts = summary.statistics.channel_message_counts
            else:
                self._scan()
        except BaseException:
            self.close()
            raise

    @property
    def topics(self) -> dict[str, Topic]:
        """Type and encoding of each topic, by topic name."""
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
        """Return (entry, topic) of each message on `topics`, in time order."""
        names = {
            key: channel.topic for key, channel in self._channels.items() if channel.topic in topics
        }
        found = self._scanned
        if found is None:
            found = []
            for chunk in self._chunks:
                for channel, offset in chunk.message_index_offsets.items():
                    if channel in names:
                        self._seek(self._file, offset, _MESSAGE_INDEX)
                        _, size = _INDEX_HEAD.unpack(self._file.read(_INDEX_HEAD.size))
                        for time, place in _INDEX_ENTRY.iter_unpack(self._file.read(size)):
                            entry = Entry(time, (chunk.chunk_start_offset, place))
                            found.append((channel, entry))
            counts = Counter(channel for channel, _ in found)
            if any(counts[key] != self._counts.get(key, 0) for key in names):
                # The index is incomplete.
                found = self._scan()
        # Messages with equal times keep their order in the file.
        return sorted((entry, names[key]) for key, entry in found if key in names)

    def read(self, entry: Entry) -> bytes:
        chunk, offset = entry.place
        stream = self._file if chunk < 0 else self._unpacked(chunk)
        length = self._seek(stream, offset, _MESSAGE)
        if _MESSAGE_HEAD.unpack(stream.read(_MESSAGE_HEAD.size))[2] != entry.time:
            raise BagError(self._path, f"its index is damaged: another time at {entry.place}")
        return stream.read(length - _MESSAGE_HEAD.size)

    def close(self) -> None:
        self._file.close()

    def _scan(self, *, recover: bool = False) -> list[tuple[int, Entry]]:
        """Scan the file and return (channel, entry) for each message."""
        self._scanned = []
        try:
            self._scan_records(self._file, len(MAGIC), self._size)
        # Damaged data may cause any exception in the decompression packages.
        except Exception as error:
            if not recover or isinstance(error, LimitError):
                raise
            text = "is damaged and read up to the last whole chunk; 'mcap recover' may save more"
            warnings.warn(f"{self._path}: {text}", stacklevel=2)
        return self._scanned

    def _scan_records(self, stream: BinaryIO, start: int, end: int, chunk: int = -1) -> None:
        assert self._scanned is not None
        records = package("mcap.records", self._path)
        streams = package("mcap.data_stream", self._path)
        kinds = {
            _SCHEMA: (records.Schema, self._schemas),
            _CHANNEL: (records.Channel, self._channels),
        }
        while start < end:
            stream.seek(start)
            code, length = _RECORD.unpack(stream.read(_RECORD.size).ljust(_RECORD.size, b"\0"))
            after = start + _RECORD.size + length
            if code == 0 or after > end:
                raise BagError(self._path, f"is damaged: no whole record at {start}; {_HINT}")
            if code == _DATA_END:
                return
            if code == _MESSAGE:
                channel, _, time, _ = _MESSAGE_HEAD.unpack(stream.read(_MESSAGE_HEAD.size))
                self._scanned.append((channel, Entry(time, (chunk, start))))
            elif code == _CHUNK:
                content = self._unpacked(start)
                self._scan_records(content, 0, content.seek(0, os.SEEK_END), start)
            elif code in kinds:
                data = io.BytesIO(stream.read(length))
                kind, kept = kinds[code]
                record = kind.read(streams.ReadDataStream(data))
                kept[record.id] = record
            start = after

    def _seek(self, stream: BinaryIO, offset: int, code: int) -> int:
        """Move `stream` to the content of the record at `offset`, and return its length [bytes]."""
        stream.seek(offset)
        found, length = _RECORD.unpack(stream.read(_RECORD.size))
        if found != code:
            raise BagError(self._path, f"its index is damaged: no record {code} at {offset}")
        return int(length)

    def _unpacked(self, offset: int) -> BinaryIO:
        """Return the decompressed chunk at `offset` as a stream."""
        if self._chunk is None or self._chunk[0] != offset:
            self._seek(self._file, offset, _CHUNK)
            size, checksum, length = _CHUNK_HEAD.unpack(self._file.read(_CHUNK_HEAD.size))
            compression = self._file.read(length).decode()
            packed_size = int.from_bytes(self._file.read(8), "little")
            data = self._file.read(min(packed_size, self._size))
            if compression:
                check_bytes(f"{self._path}: a chunk", size, packed_size)
            if compression == "lz4":
                data = package("lz4.frame", self._path).decompress(data)
            elif compression == "zstd":
                data = package("zstandard", self._path).decompress(data, size)
            elif compression:
                raise BagError(self._path, f"its compression {compression!r} is not known")
            if len(data) != size or (checksum and zlib.crc32(data) != checksum):
                raise BagError(self._path, f"is damaged: a wrong chunk at {offset}; {_HINT}")
            self._chunk = offset, io.BytesIO(data)
        return self._chunk[1]


# --- writing --------------------------------------------------------------------------------------


class McapWriter:
    """Writes serialized messages to a new MCAP file.

    If `reserve` is true, the file can be completed even if the disk fills up.
    """

    def __init__(self, path: Path, compression: str = "none", *, reserve: bool = False) -> None:
        writer = package("mcap.writer", path)
        kind = writer.CompressionType[compression.upper()]
        self._file = path.open("xb")
        self._reserves = reserve
        self._reserved = self._written = self._waiting = 0
        self._writer = writer.Writer(self._file, chunk_size=_CHUNK_SIZE, compression=kind)
        self._writer.start(profile="ros2", library="grid_map_ros_py")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def write(self, topic: str, kind: Topic, time: int, data: bytes) -> None:
        if self._reserves:
            written = self._file.tell()
            if written != self._written:
                self._written, self._waiting = written, 0
            self._waiting += len(data) + _RESERVE_PER_MESSAGE
            # The chunk index needs less than 1/1024 of the size of the chunks.
            needed = written + written // 1024 + self._waiting + _RESERVE
            if needed > self._reserved:
                os.posix_fallocate(self._file.fileno(), self._reserved, needed - self._reserved)
                self._reserved = needed
        if kind.type not in self._schemas:
            encoding = "ros2msg" if kind.definition else ""
            definition = kind.definition.encode()
            self._schemas[kind.type] = self._writer.register_schema(kind.type, encoding, definition)
        if topic not in self._channels:
            metadata = {"offered_qos_profiles": kind.qos, "topic_type_hash": kind.type_hash}
            self._channels[topic] = self._writer.register_channel(
                topic, kind.encoding, self._schemas[kind.type], metadata
            )
        self._writer.add_message(self._channels[topic], time, data, time)

    def finish(self, information: object) -> None:
        """Write the bag metadata and the index, then close the file."""
        self._writer.add_metadata("rosbag2", {"serialized_metadata": dump(information)})
        self._writer.finish()
        self._file.truncate()
        self._file.close()

    def close(self) -> None:
        """Close the file; call `finish` first, or the file is invalid."""
        with suppress(OSError):
            self._file.close()
