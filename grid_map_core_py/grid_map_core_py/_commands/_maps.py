# SPDX-License-Identifier: BSD-3-Clause
"""Reads and writes the map files named on a command line."""

import argparse
import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, TypeAlias

from .._unfinished import scratch_folder
from ..errors import GridMapError
from ._output import CommandError, UsageError, message

if TYPE_CHECKING:
    from ..files import Format
    from ..files._formats import MapRecord
    from ..map import GridMap

TimedMap: TypeAlias = "tuple[int | None, GridMap]"
"""Recording time [ns] (None if unknown), and the map."""

STANDARD = "-"
"""File name that stands for standard input or output, which use the npz format."""

_READING = (
    *("topic", "index", "recover", "resolution", "black", "white", "height_layer"),
    *("kind", "reduction", "min_height", "max_height", "tight"),
)
_WRITING = (
    *("compress", "bits", "mode", "crs", "storage", "output_topic", "chunks"),
    *("black", "white", "data_min", "data_max"),
)
_NAMES = {"black": "lower", "white": "upper", "output_topic": "topic"}
"""Maps command-line options to the format options that they set, where the names differ."""

_FLAGS = {"kind": "--as", "reduction": "--reduce"}


def _choose(
    options: argparse.Namespace, of_source: Iterable[str] | None = None
) -> "tuple[Format, dict[str, Any]]":
    """Return the format and the given options of the source, or of the destination.

    If `of_source` is given, the destination is handled. The options in `of_source` are accepted.
    """
    from ..files._formats import find_format, formats, options_of

    writes = of_source is not None
    # `--black` and `--white` may be for the source or for the destination. If neither format
    # accepts them, the call for the destination raises an error.
    shared = ("lower", "upper") if hasattr(options, "destination") else ()
    elsewhere = shared if of_source is None else of_source

    def known(one: "Format") -> tuple[str, ...]:
        return options_of(one.save, 2) if writes else options_of(one.load)

    path = options.destination if writes else options.source
    wanted = options.to if writes else getattr(options, "from_format", None)
    flags, given = {}, {}
    for name in _WRITING if writes else _READING:
        if (value := getattr(options, name, None)) is not None:
            called = _NAMES.get(name, name)
            flags[called], given[called] = name, value
    if path == STANDARD:
        if wanted not in (None, "npz"):
            side = "output" if writes else "input"
            raise UsageError(f"standard {side} takes npz, not {wanted}")
        found = formats()["npz"]
    else:
        try:
            found = find_format(Path(path), given, name=wanted, writes=writes)
        except GridMapError:
            found = find_format(Path(path), name=wanted, writes=writes)
    for called, name in flags.items():
        if called not in (*known(found), *elsewhere):
            flag = _FLAGS.get(name, f"--{name.replace('_', '-')}")
            having = ", ".join(one.name for one in formats().values() if called in known(one))
            raise UsageError(f"{flag} is for {having}, and this is {found.name}")
    return found, {called: given[called] for called in known(found) if called in given}


def source_format(options: argparse.Namespace) -> str:
    return _choose(options)[0].name


def read_map(options: argparse.Namespace, layers: Iterable[str] | None = None) -> "GridMap":
    """Read the map that the arguments of `add_source` select; `layers=None` reads all layers."""
    found, given = _choose(options)
    with _source(options.source) as path:
        return found.load(path, layers=layers, **given)  # type: ignore[misc]


def describe(options: argparse.Namespace) -> dict[str, Any]:
    """Return the format, size and metadata of the source as JSON values."""
    from ..files._formats import options_of
    from ..files._shared import map_facts

    found, given = _choose(options)
    with _source(options.source) as path:
        if found.describe is None:
            facts = {"map": map_facts(found.load(path, **given))}  # type: ignore[misc]
        else:
            known = options_of(found.describe)
            facts = found.describe(path, **{n: given[n] for n in known if n in given})
    size = None
    if options.source != STANDARD and "://" not in options.source:
        path = Path(options.source)
        files = path.iterdir() if path.is_dir() else [path]
        size = sum(file.stat().st_size for file in files if file.is_file())
    return {"path": options.source, "format": found.name, "bytes": size} | facts


@contextmanager
def open_records(
    options: argparse.Namespace, destination: "Destination", layers: Iterable[str] | None = None
) -> "Iterator[Sequence[MapRecord]]":
    """Yield the map records to copy: one map, or all maps of a bag.

    All maps are copied if the destination can store several maps and `--index` is not given.
    """
    if _choose(options)[0].open_maps is None:
        grid_map = read_map(options, layers)
        record: Any = SimpleNamespace(time=None, grid_map=lambda *_, **__: grid_map)
        yield [record]
        return
    with open_recording(options) as records:
        if destination.takes_many:
            bag = Path(options.source).resolve()
            if Path(destination.path).resolve() in (bag, bag.parent):
                raise CommandError(
                    f"{destination.path}: is also the source; its other topics would be lost"
                )
            destination.usual_topic = destination.usual_topic or records.topic  # type: ignore[attr-defined]
        if options.index is not None:
            yield [records[options.index]]
        elif destination.takes_many:
            yield records
        else:
            if len(records) > 1:
                message(f"{options.source}: last of {len(records)} maps; --index selects another")
            yield [records[-1]]


@contextmanager
def open_recording(options: argparse.Namespace) -> "Iterator[Sequence[MapRecord]]":
    """Yield records of all maps of a bag, regardless of `--index`."""
    found, given = _choose(options)
    if found.open_maps is None:
        raise CommandError(f"{options.source}: expected a bag, which holds many maps")
    given.pop("index", None)
    with found.open_maps(options.source, **given) as records:
        yield records


@contextmanager
def _source(path: str) -> Iterator[Path | str]:
    """Yield the source path or URL; standard input is first copied to a file."""
    if path != STANDARD:
        yield path if "://" in path else Path(path)
        return
    if sys.stdin is None or sys.stdin.isatty():
        raise CommandError("expected an .npz file on standard input, from a file or a pipe")
    with scratch_folder() as folder:
        file = folder / "map.npz"
        with file.open("wb") as copy:
            shutil.copyfileobj(sys.stdin.buffer, copy)
        try:
            yield file
        except GridMapError as error:
            raise CommandError(str(error).replace(str(file), "standard input")) from error


class Destination:
    """Destination of maps, selected by the `add_destination` arguments.

    `usual_topic` is the default topic in a bag. None means the topic of the source, or `/grid_map`.
    """

    def __init__(self, options: argparse.Namespace, usual_topic: str | None = None) -> None:
        self.path: str = options.destination
        self.usual_topic = usual_topic
        source, source_given = _choose(options)
        self._holds_many = source.open_maps is not None
        try:
            self.format, self._given = _choose(options, source_given)
        except GridMapError as error:
            raise UsageError(str(error)) from error
        if self.path == STANDARD and (sys.stdout is None or sys.stdout.isatty()):
            raise CommandError("expected a pipe or a file at standard output, for an .npz file")
        check_free(self.path, force=options.force)

    @property
    def takes_many(self) -> bool:
        return self.format.save_maps is not None

    def takes_all(self, options: argparse.Namespace) -> bool:
        """Return whether to copy all messages of a bag, not only its maps."""
        is_whole = (options.topic, options.index, options.layers) == (None, None, None)
        return self.format.save_all is not None and self._holds_many and is_whole

    def write_all(self, options: argparse.Namespace) -> None:
        """Copy all messages from the source, and print the message count."""
        given = {"recover": True} if options.recover else {}
        count = self.format.save_all(options.source, self.path, **given)  # type: ignore[misc]
        message(f"{count} messages in {self.path}")

    def write(self, maps: Iterable[TimedMap]) -> int:
        """Write maps one by one, and return their number."""
        if self.format.save_maps is not None:
            topic = {"topic": self.usual_topic or "/grid_map"}
            return self.format.save_maps(self.path, maps, **topic | self._given)
        count = 0
        for _, grid_map in maps:
            count += 1
            if self.path != STANDARD:
                self.format.save(grid_map, self.path, **self._given)  # type: ignore[misc]
                continue
            # `save` can only write to a path, where it replaces the file.
            with scratch_folder() as folder:
                path = folder / "map.npz"
                self.format.save(grid_map, path, **self._given)  # type: ignore[misc]
                with path.open("rb") as file:
                    shutil.copyfileobj(file, sys.stdout.buffer)
        if not count:
            raise CommandError(f"{self.path}: there is no map to write")
        return count

    def tell(self, count: int) -> None:
        if self.path != STANDARD:
            message(f"{count} {'map' if count == 1 else 'maps'} in {self.path}")


def check_free(path: str, *, force: bool) -> None:
    """Raise `CommandError` if `path` exists and must not be replaced."""
    if path == STANDARD or not os.path.lexists(path):
        return
    file = Path(path)
    if file.exists() and not (file.is_file() or file.is_dir()):
        raise CommandError(f"{path}: is neither a file nor a folder, and not replaced")
    if not force:
        raise CommandError(f"{path}: already exists; --force replaces it")
