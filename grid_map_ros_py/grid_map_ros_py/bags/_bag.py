# SPDX-License-Identifier: BSD-3-Clause
"""Bag readers and writers, and convenience functions that load and save maps."""

import bisect
import os
import re
import shutil
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self, TypeAlias

from grid_map_core_py import GridMap
from grid_map_core_py.errors import LimitError, MissingPackageError, required, short
from grid_map_core_py.files._shared import new_folder
from grid_map_core_py.limits import check_bytes

from ..errors import BagError, MessageError
from ..messages._fields import check_nanoseconds
from ..messages._grid_map import from_serialized_message, to_serialized_message
from . import _mcap as bag_mcap, _sqlite as bag_sqlite, _storage as bag_storage
from ._mcap import COMPRESSIONS, McapFile, McapWriter, package
from ._rosbag2 import Rosbag2File, Rosbag2Writer
from ._sqlite import SqliteFile, SqliteWriter
from ._storage import GRID_MAP_TYPE, MAPS, Entry, Topic, bag_errors

STORAGES = {"mcap": ".mcap", "sqlite3": ".db3"}
"""File name extensions of new bags, by storage format."""

_Storage: TypeAlias = McapFile | Rosbag2File | SqliteFile
"""Open storage file. Call its methods within `bag_errors`, because they may raise any exception if
the file is damaged."""

_TOPIC_NAME = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_ROS1_MAGIC = b"#ROSBAG"
_ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_BAG_ENDINGS = {".mcap", ".db3", ".db3-wal", ".db3-shm", ".zstd"}
"""Extensions of the storage files in a bag folder."""


# --- writing --------------------------------------------------------------------------------------


def save_to_bag(
    maps: GridMap | Iterable[GridMap],
    path: str | PathLike[str],
    topic: str,
    *,
    layers: Iterable[str] | None = None,
    overwrite: bool = True,
    storage: str = "auto",
    compression: str = "none",
) -> None:
    """Write maps to a new bag.

    If saving is interrupted, an existing bag stays unchanged.

    Args:
        maps: one map or an iterable of maps; each map is written before the next one is requested.
        path: folder of the bag.
        layers: names of the layers to write; None means all.
        overwrite: replace an existing bag. Other files and folders are never replaced.
        storage: format of the bag: "mcap", "sqlite3" or "auto". The C++ function `loadFromBag`
            reads only "sqlite3". "auto" selects "mcap" if the package `mcap` or `rosbag2_py` is
            installed. Otherwise, it selects "sqlite3" and issues a warning.
        compression: "none", "lz4" or "zstd" for MCAP; "none" for sqlite3.
    """
    names = _once(layers)
    writer = BagWriter(path, overwrite=overwrite, storage=storage, compression=compression)
    with writer as bag:
        for grid_map in (maps,) if isinstance(maps, GridMap) else maps:
            bag.write(topic, grid_map, layers=names)


class BagWriter:
    """Context manager that writes maps to a bag, one at a time.

    If the context ends without an exception, the new bag replaces any existing bag.

    Args:
        path, overwrite, storage, compression: as in `save_to_bag`.
        in_place: write directly to `path`, after deleting any existing bag. Use this option for
            long recordings. After a crash, the bag can be read with `recover=True`. An MCAP bag can
            be completed even if the disk is full.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        overwrite: bool = True,
        storage: str = "auto",
        compression: str = "none",
        in_place: bool = False,
    ) -> None:
        self._path = Path(path)
        if not os.fspath(path):
            # `Path("")` is the working folder, which could be a bag.
            raise BagError("path", "expected the folder of a bag, got ''")
        self._overwrite = overwrite
        self._in_place = in_place
        asked, storage = storage, chosen_storage(storage)
        if asked != storage == "sqlite3" and compression in COMPRESSIONS[1:]:
            raise MissingPackageError("mcap", f"compression {compression!r}")
        self._storage, self._compression = storage, compression
        compressions = ("none",) if storage == "sqlite3" else COMPRESSIONS
        for name, value, known in (
            ("storage", storage, ("auto", *STORAGES)),
            (f"compression of {storage}", compression, compressions),
        ):
            if value not in known:
                expected = " or ".join(map(repr, known))
                raise BagError(self._path, f"{name}: expected {expected}, got {short(value)}")
        if storage == "mcap":
            _, self._mcap_writer = _mcap_classes(self._path)

    def __enter__(self) -> "BagWriter":
        with bag_errors(self._path, "written"), ExitStack() as stack:
            self._check_parent()
            self._folder = stack.enter_context(self._new_folder())
            self._file = f"{self._path.resolve().name}_0{STORAGES[self._storage]}"
            file = self._folder / self._file
            self._writer: McapWriter | Rosbag2Writer | SqliteWriter = (
                self._mcap_writer(file, self._compression, reserve=self._in_place)
                if self._storage == "mcap"
                else SqliteWriter(file, in_place=self._in_place)
            )
            stack.enter_context(closing(self._writer))
            self._topics: dict[str, Topic] = {}
            self._times: dict[str, list[int]] = {}
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is not None:
            self._stack.__exit__(kind, error, traceback)
            return
        with bag_errors(self._path, "written"), self._stack:
            if not self._times:
                raise BagError(self._path, "no maps to write")
            document = bag_storage.information(self._topics, self._times, self._file, self._storage)
            self._writer.finish(document)
            bag_storage.save(self._folder, document)

    def check(self, topic: str) -> None:
        """Raise `BagError` if a map cannot be written to `topic`."""
        self._check_topic(topic)
        with bag_errors(self._path, "written"):
            self._check_parent()
            parent = self._path.resolve().parent
            if not os.access(parent, os.W_OK | os.X_OK):
                reason = "may not be written to" if parent.is_dir() else "is no folder"
                raise BagError(self._path, f"cannot be written: {parent} {reason}")
            if self._path.exists():
                self._check_old(self._path.resolve())

    def write(
        self,
        topic: str,
        grid_map: GridMap,
        *,
        time: int | None = None,
        layers: Iterable[str] | None = None,
    ) -> None:
        """Append a map.

        Args:
            time: time of the message [ns]; None means the timestamp of the map.
            layers: names of the layers to write; None means all.
        """
        self._check_topic(topic)
        if not isinstance(grid_map, GridMap):
            found = type(grid_map).__name__
            raise BagError(self._path, f"expected a GridMap to write, got {found}")
        stamp = check_nanoseconds(grid_map.timestamp if time is None else time)
        self.write_serialized(topic, MAPS, stamp, to_serialized_message(grid_map, layers))

    def write_serialized(self, topic: str, kind: Topic, time: int, data: bytes) -> None:
        """Append a serialized message of any type, recorded at `time` [ns]."""
        with bag_errors(self._path, "written"):
            self._writer.write(topic, self._topics.setdefault(topic, kind), time, data)
        self._times.setdefault(topic, []).append(time)

    @contextmanager
    def _new_folder(self) -> Iterator[Path]:
        """Yield the folder to write to: a temporary folder or, with `in_place`, the bag itself."""
        if not self._in_place:
            with new_folder(self._path, self._check_old) as folder:
                yield folder
            return
        folder = self._path.resolve()  # the target of a link
        if folder.exists():
            self._check_old(folder)
            shutil.rmtree(folder)
        folder.mkdir()
        try:
            yield folder
        finally:
            if not self._times:
                shutil.rmtree(folder)

    def _check_topic(self, topic: str) -> None:
        if not _TOPIC_NAME.fullmatch(topic):
            raise BagError(self._path, f"expected the name of a topic, got {topic!r}")

    def _check_parent(self) -> None:
        """Raise `BagError` if `path` is inside another bag, which could then not be replaced."""
        parent = self._path.resolve().parent
        if Path(parent, bag_storage.FILE_NAME).is_file() and any(
            file.suffix in _BAG_ENDINGS for file in parent.iterdir()
        ):
            raise BagError(self._path, f"is inside the bag {parent.name}. Choose another folder")

    def _check_old(self, target: Path) -> None:
        """Raise `BagError` unless `target` is a bag or an empty folder."""
        if not target.is_dir():
            raise BagError(self._path, "is a file, and a bag is a folder")
        names = sorted(path.name for path in target.iterdir())
        others = [name for name in names if name != bag_storage.FILE_NAME]
        foreign = [name for name in others if Path(name).suffix not in _BAG_ENDINGS]
        if foreign or (names and others == names):
            raise BagError(
                self._path, f"is not a bag and is not replaced; it holds {(foreign or names)[0]}"
            )
        if names and not self._overwrite:
            raise BagError(self._path, "already exists")


# --- reading --------------------------------------------------------------------------------------


def load_from_bag(
    path: str | PathLike[str],
    topic: str | None = None,
    layers: Iterable[str] | None = None,
    *,
    index: int = -1,
    time: int | None = None,
    unwrap: bool = True,
    recover: bool = False,
) -> GridMap:
    """Load one map from a bag, by default the last map on the topic.

    Args:
        path: folder of a bag, or an MCAP or sqlite3 (`.db3`) file.
        topic: topic to read; None means the only topic with maps.
        layers: names of the layers to read; None means all.
        index: index of the map in time order: 0 is the first, -1 the last.
        time: recording time [ns]. The last map up to this time is loaded, and `index` has no
            effect.
        unwrap: see `from_message`.
        recover: read a damaged MCAP file up to the last complete chunk, and issue a warning. A
            killed recorder, for example, may leave a damaged file.
    """
    with BagReader(path, topic, recover=recover) as bag:
        record = bag[index] if time is None else bag.at(time)
        return record.grid_map(layers, unwrap=unwrap)


def bag_maps(
    path: str | PathLike[str],
    topic: str | None = None,
    layers: Iterable[str] | None = None,
    *,
    recover: bool = False,
) -> Iterator[GridMap]:
    """Yield the maps on a topic in time order.

    See `load_from_bag` for the arguments.
    """
    names = _once(layers)
    with BagReader(path, topic, recover=recover) as bag:
        for record in bag:
            yield record.grid_map(names)


@dataclass(frozen=True)
class BagTopic:
    """A bag topic of any message type.

    Attributes:
        name: name of the topic.
        type: message type, such as `grid_map_msgs/msg/GridMap`.
        count: number of messages.
        first, last: earliest and latest message time [ns]; None if there are no messages.
    """

    name: str
    type: str
    count: int = 0
    first: int | None = None
    last: int | None = None

    @property
    def holds_maps(self) -> bool:
        """True if the topic contains at least one map."""
        return self.type == GRID_MAP_TYPE and self.count > 0


def bag_topics(path: str | PathLike[str], *, recover: bool = False) -> list[BagTopic]:
    """Return the topics of a bag, sorted by name; `recover` is as in `load_from_bag`."""
    with BagFiles(path, recover=recover) as files:
        times: dict[str, list[int]] = {name: [] for name in sorted(files.topics)}
        for entry, _, name in files.entries(times):
            times[name].append(entry.time)
        return [
            BagTopic(name, files.topics[name].type, len(found), *(found[:1] + found[-1:]))
            for name, found in times.items()
        ]


class BagMessage(NamedTuple):
    """A CDR-encoded message of a bag.

    `time` is the recording time [ns]. `place` names the bag and the message, for error messages.
    """

    topic: str
    type: str
    time: int
    data: bytes
    place: str

    def grid_map(self, layers: Iterable[str] | None = None, *, unwrap: bool = True) -> GridMap:
        """Decode the map; the arguments are the same as in `from_message`."""
        try:
            return from_serialized_message(self.data, layers, unwrap=unwrap)
        except MessageError as error:
            raise BagError(self.place, str(error)) from error
        except LimitError as error:
            raise LimitError(f"{self.place}: {error}") from error


class BagFiles:
    """Reads messages of any type from the files of a bag.

    Close the reader after use, or use it as a context manager.

    Attributes:
        paths: storage files of the bag.
        topics: type, encoding and quality of service of each topic, by topic name.
    """

    def __init__(self, path: str | PathLike[str], *, recover: bool = False) -> None:
        self._open: tuple[int, _Storage] | None = None
        self._path, self._recover = Path(path), recover
        with bag_errors(self._path):
            self.paths = bag_storage.files_of(self._path, recover=recover)
        self.topics: dict[str, Topic] = {}
        try:
            for number, path in enumerate(self.paths):
                with bag_errors(path):
                    self.topics |= self._storage(number).topics
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the currently open storage file."""
        if self._open is not None:
            self._open[1].close()
            self._open = None

    def entries(self, topics: Iterable[str]) -> list[tuple[Entry, int, str]]:
        """Return (entry, file number, topic) for each message on `topics`, in time order."""
        found, wanted = list[tuple[Entry, int, str]](), {*topics}
        for number, path in enumerate(self.paths):
            with bag_errors(path):
                entries = self._storage(number).entries(wanted)
                found += [(entry, number, topic) for entry, topic in entries]
        # The files of a split bag may overlap in time.
        return sorted(found, key=lambda one: one[0].time)

    def read(self, file: int, entry: Entry) -> bytes:
        """Return the decompressed bytes of a message."""
        path = self.paths[file]
        with bag_errors(path):
            data = self._storage(file).read(entry)
            if data.startswith(_ZSTD_MAGIC):
                # The bag uses the per-message compression of rosbag2.
                zstandard = package("zstandard", path)
                check_bytes(f"{path}: a message", zstandard.frame_content_size(data), len(data))
                data = zstandard.decompress(data)
        return data

    def _storage(self, file: int) -> _Storage:
        """Return a storage file, opened if necessary; other files are closed."""
        if self._open is None or self._open[0] != file:
            self.close()
            self._open = file, _open(self.paths[file], recover=self._recover)
        return self._open[1]


def bag_messages(
    path: str | PathLike[str], types: Iterable[str] | None = None, *, recover: bool = False
) -> Iterator[BagMessage]:
    """Yield the messages of a bag in time order, reading one at a time.

    Args:
        path, recover: as for `load_from_bag`.
        types: message types to read; None means all. Topics not encoded in CDR are skipped.
    """
    wanted = None if types is None else {*types}
    with BagFiles(path, recover=recover) as files:
        topics = {
            name: kind.type
            for name, kind in files.topics.items()
            if kind.encoding == "cdr" and (wanted is None or kind.type in wanted)
        }
        counts = dict.fromkeys(topics, 0)
        for entry, file, topic in files.entries(topics):
            place = f"{files.paths[file]}: message {counts[topic]} on {topic}"
            counts[topic] += 1
            yield BagMessage(topic, topics[topic], entry.time, files.read(file, entry), place)


class BagReader(BagFiles):
    """Sequence of the map messages (`BagMessage`) on one topic of a bag, in time order.

    A message is read when it is accessed, and decoded by its method `grid_map`. Close the reader
    after use, or use it as a context manager. See `load_from_bag` for the arguments.
    """

    def __init__(
        self, path: str | PathLike[str], topic: str | None = None, *, recover: bool = False
    ) -> None:
        super().__init__(path, recover=recover)
        try:
            self.topic = self._chosen(topic)
            self._entries = self.entries([self.topic])
        except BaseException:
            self.close()
            raise

    def __len__(self) -> int:
        return len(self._entries)

    def __getitem__(self, index: int) -> BagMessage:
        if not -len(self) <= index < len(self):
            raise BagError(self._path, f"no map {index}: {len(self)} maps on {self.topic}")
        entry, file, _ = self._entries[index]
        place = f"{self.paths[file]}: map {index % len(self)} on {self.topic}"
        return BagMessage(self.topic, GRID_MAP_TYPE, entry.time, self.read(file, entry), place)

    def __iter__(self) -> Iterator[BagMessage]:
        for index in range(len(self)):
            yield self[index]

    def at(self, time: int) -> BagMessage:
        """Return the last message recorded at or before `time` [ns]."""
        before = bisect.bisect_right(self._entries, time, key=lambda found: found[0].time)
        if not before:
            first = f"; the first is of {self._entries[0][0].time}" if self._entries else ""
            raise BagError(self._path, f"no map on {self.topic} up to time {time}{first}")
        return self[before - 1]

    def _chosen(self, topic: str | None) -> str:
        """Check and return `topic`; None means the only topic with maps."""
        with_maps = [name for name, kind in self.topics.items() if kind.type == GRID_MAP_TYPE]
        if topic is None:
            if len(with_maps) != 1:
                reason = f"{len(with_maps)} topics of maps, name one"
                raise BagError(self._path, f"{reason}; {self._listed()}")
            (topic,) = with_maps
        if topic not in self.topics:
            raise BagError(self._path, f"no topic {topic!r}; {self._listed()}")
        kind = self.topics[topic]
        if kind.type != GRID_MAP_TYPE:
            raise BagError(
                self._path, f"{topic} is of type {kind.type}, not {GRID_MAP_TYPE}; {self._listed()}"
            )
        if kind.encoding != "cdr":
            reason = f"{topic} is encoded as {kind.encoding!r}, only 'cdr' is read"
            raise BagError(self._path, reason)
        return topic

    def _listed(self) -> str:
        listed = ", ".join(f"{name} ({kind.type})" for name, kind in sorted(self.topics.items()))
        return f"topics: {listed or '(none)'}"


def _open(path: Path, *, recover: bool) -> _Storage:
    """Open a storage file as MCAP or sqlite3, as its first bytes indicate."""
    with path.open("rb") as file:
        magic = file.read(len(bag_sqlite.MAGIC))
    if magic.startswith(bag_mcap.MAGIC):
        reader, _ = _mcap_classes(path)
        return reader(path, recover=recover)
    if magic == bag_sqlite.MAGIC:
        return SqliteFile(path)
    if magic.startswith(_ROS1_MAGIC):
        raise BagError(path, "a bag of ROS 1; 'rosbags-convert' converts it")
    if magic.startswith(_ZSTD_MAGIC):
        raise BagError(path, "is compressed as a whole; 'zstd -d' unpacks it")
    raise BagError(path, "neither an MCAP file nor a sqlite3 database" if magic else "is empty")


def _mcap_classes(
    path: Path,
) -> tuple[type[McapFile | Rosbag2File], type[McapWriter | Rosbag2Writer]]:
    """Return the reader and writer of MCAP files, from `mcap` or else from `rosbag2_py`."""
    try:
        package("mcap.writer", path)
    except MissingPackageError:
        with suppress(MissingPackageError):
            required("rosbag2_py", "")
            return Rosbag2File, Rosbag2Writer
        raise
    return McapFile, McapWriter


def chosen_storage(storage: str, warn: Callable[[str], object] = warnings.warn) -> str:
    """Return `storage`, but replace "auto" with "mcap" if possible, else with "sqlite3"."""
    if storage != "auto":
        return storage
    try:
        _mcap_classes(Path())
    except MissingPackageError as error:
        package, _, remedy = error.args
        warn(f"bags are saved as sqlite3: the package {package!r} is not installed: {remedy}")
        return "sqlite3"
    return "mcap"


def _once(layers: Iterable[str] | None) -> tuple[str, ...] | None:
    """Return layer names as a tuple, so that an iterator can be used for several maps."""
    return (layers,) if isinstance(layers, str) else None if layers is None else tuple(layers)
