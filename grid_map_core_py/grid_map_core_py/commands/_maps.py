# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Maps from and to the files that a command line names.

What takes long to import is imported by the functions that need it.
"""

import argparse
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from ..errors import GridMapError
from ._errors import CommandError, UsageError
from ._output import message

if TYPE_CHECKING:
    from ..files import Format, MapRecord
    from ..map import GridMap

TimedMap: TypeAlias = "tuple[int | None, GridMap]"
"""A map, and when it was recorded [ns] if that is known."""

STANDARD = "-"
"""Names standard input or output, which are of the format npz."""

_READING = {
    **{name: name for name in ("topic", "index", "resolution", "height_layer", "kind")},
    **{name: name for name in ("reduction", "min_height", "max_height")},
    "black": "lower",
    "white": "upper",
}
_WRITING = {
    **{name: name for name in ("compress", "bits", "mode", "crs", "storage")},
    "output_topic": "topic",
    "black": "lower",
    "white": "upper",
}
"""Options of the command line by where argparse keeps them, and their names in formats."""

_FLAGS = {"kind": "--as", "reduction": "--reduce"}


def _given(options: argparse.Namespace, names: Mapping[str, str]) -> dict[str, Any]:
    """Return the options of formats that were given, by their names in formats."""
    values = {called: getattr(options, name, None) for name, called in names.items()}
    return {name: value for name, value in values.items() if value is not None}


def _fitting(find: "Callable[..., Format]", path: str, name: str | None, given: Any) -> "Format":
    """Return the format of a path, one with all options if there is one."""
    with suppress(GridMapError):
        return find(Path(path), given, name=name)
    return find(Path(path), name=name)


def _foreign(called: str, names: Mapping[str, str], found: "Format", *, writes: bool) -> UsageError:
    """Return the error that a format lacks an option, which names the formats that have it."""
    from ..files import formats, options_of

    name = next(name for name in names if names[name] == called)
    flag = _FLAGS.get(name, f"--{name.replace('_', '-')}")
    having = [
        one.name
        for one in formats().values()
        if called in (options_of(one.save, 2) if writes else options_of(one.load))
    ]
    return UsageError(f"{flag} is for {', '.join(having)}, and this is {found.name}")


# --- reading --------------------------------------------------------------------------------------


def read_map(options: argparse.Namespace, layers: Iterable[str] | None = None) -> "GridMap":
    """Return the map that the arguments of `add_source` and `add_choice_of_map` name.

    Args:
        options: the arguments.
        layers: names of the layers to read; None means all.

    Raises:
        UsageError: an option is for other formats.
        GridMapError: the map cannot be read.
    """
    found, given = _source_format(options)
    with _source(options.source) as path:
        return found.load(path, layers=layers, **given)  # type: ignore[misc]


def describe(options: argparse.Namespace, **changes: Any) -> dict[str, Any]:
    """Return the format, the size and the facts of the source, as JSON has them.

    Args:
        options: the arguments of `add_source` and `add_choice_of_map`.
        changes: values in place of those of `options`.

    Raises:
        UsageError: an option is for other formats.
        GridMapError: the file cannot be read.
    """
    from ..files import map_facts, options_of

    options = argparse.Namespace(**{**vars(options), **changes})
    found, given = _source_format(options)
    head = {"path": options.source, "format": found.name, "bytes": _size(options.source)}
    with _source(options.source) as path:
        if found.describe is None:
            return head | {"map": map_facts(found.load(path, **given))}  # type: ignore[misc]
        known = options_of(found.describe)
        return head | found.describe(path, **{name: given[name] for name in known if name in given})


class _Only(NamedTuple):
    """The record of a file that holds one map."""

    time: int | None
    made: "GridMap"

    def grid_map(self, layers: object = None, *, unwrap: bool = True) -> "GridMap":  # noqa: ARG002
        return self.made


@contextmanager
def open_records(
    options: argparse.Namespace, destination: "Destination", layers: Iterable[str] | None = None
) -> "Iterator[Sequence[MapRecord]]":
    """Yield records of the maps that go from the source to the destination.

    These are all maps of a bag if the destination is a bag and `--index` is not given, else one
    map.

    Args:
        options: the arguments of `add_source` and `add_choice_of_map`.
        destination: where the maps go.
        layers: names of the layers to read; None means all.

    Raises:
        UsageError: an option is for other formats.
        GridMapError: the source cannot be read, or the destination would replace it.
    """
    found, given = _source_format(options)
    if found.open_maps is None:
        yield [_Only(None, read_map(options, layers))]  # type: ignore[list-item]
        return
    with found.open_maps(options.source, topic=given.get("topic")) as records:
        index = given.get("index")
        if destination.takes_many:
            bag = Path(options.source).resolve()
            if Path(destination.path).resolve() in (bag, bag.parent):
                raise CommandError(
                    f"{destination.path}: is the source, too; its other topics would be lost"
                )
            destination.usual_topic = records.topic  # type: ignore[attr-defined]
        if destination.takes_many and index is None:
            yield records
        else:
            yield [records[-1 if index is None else index]]


def _source_format(options: argparse.Namespace) -> "tuple[Format, dict[str, Any]]":
    """Return the format of the source and the options for it that were given."""
    from ..files import format_to_read, formats, options_of

    wanted, given = getattr(options, "from_format", None), _given(options, _READING)
    if options.source != STANDARD:
        found = _fitting(format_to_read, options.source, wanted, given)
    elif wanted in (None, "npz"):
        found = formats()["npz"]
    else:
        raise UsageError(f"standard input takes npz, not {wanted}")
    known = options_of(found.load)
    # A destination takes black and white, too, and has complained if neither does.
    other = ("lower", "upper") if hasattr(options, "destination") else ()
    for called in given:
        if called not in known and called not in other:
            raise _foreign(called, _READING, found, writes=False)
    return found, {called: value for called, value in given.items() if called in known}


@contextmanager
def _source(path: str) -> Iterator[Path]:
    """Yield the file, or one with all of standard input, which cannot be read here and there."""
    if path != STANDARD:
        yield Path(path)
        return
    if sys.stdin is None or sys.stdin.isatty():
        raise CommandError("expected an .npz file on standard input, from a file or a pipe")
    with tempfile.NamedTemporaryFile(prefix="standard-input-", suffix=".npz") as file:
        shutil.copyfileobj(sys.stdin.buffer, file)
        file.flush()
        try:
            yield Path(file.name)
        except GridMapError as error:
            raise CommandError(str(error).replace(file.name, "standard input")) from error


def _size(source: str) -> int | None:
    path = Path(source)
    if source == STANDARD:
        return None
    files = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())


# --- writing --------------------------------------------------------------------------------------


class Destination:
    """Where maps go, as the arguments of `add_destination` say.

    Args:
        options: the arguments.
        usual_topic: topic of the maps in a bag, unless the arguments name one.

    Raises:
        UsageError: the format is not known, or an option is for other formats.
        CommandError: there is something already.
    """

    def __init__(self, options: argparse.Namespace, usual_topic: str) -> None:
        from ..files import format_to_write, formats, options_of

        self.path: str = options.destination
        self.usual_topic = usual_topic
        given = _given(options, _WRITING)
        if self.path == STANDARD:
            if options.to not in (None, "npz"):
                raise UsageError(f"standard output takes npz, not {options.to}")
            if sys.stdout is None or sys.stdout.isatty():
                raise CommandError("expected a pipe or a file at standard output, for an .npz file")
            self.format = formats()["npz"]
        else:
            try:
                self.format = _fitting(format_to_write, self.path, options.to, given)
            except GridMapError as error:
                raise UsageError(str(error)) from error
        known = options_of(self.format.save, 2)
        source, source_given = _source_format(options)
        for called in given:
            if called not in known and called not in source_given:
                raise _foreign(called, _WRITING, self.format, writes=True)
        given = {called: value for called, value in given.items() if called in known}
        if source.name == self.format.name and "crs" in known and "crs" not in given:
            # A GeoTIFF stays in its reference system.
            given["crs"] = describe(options)["map"].get("crs", "")
        self._given = given
        check_free(self.path, force=options.force)

    @property
    def takes_many(self) -> bool:
        """True for a bag, which holds any number of maps."""
        return self.format.save_maps is not None

    def write(self, maps: Iterable[TimedMap]) -> int:
        """Write maps, and return their number; each is written before the next is asked for.

        Raises:
            GridMapError, OSError: they cannot be written.
        """
        if self.format.save_maps is not None:
            return self.format.save_maps(
                self.path, maps, **{"topic": self.usual_topic} | self._given
            )
        count = 0
        for _, grid_map in maps:
            if self.path == STANDARD:
                self._write_to_standard_output(grid_map)
            else:
                self.format.save(grid_map, self.path, **self._given)  # type: ignore[misc]
            count += 1
        if not count:
            raise CommandError(f"{self.path}: there is no map to write")
        return count

    def tell(self, count: int) -> None:
        """Print the number of maps that were written, unless they went to a pipe."""
        if self.path != STANDARD:
            message(f"{count} {'map' if count == 1 else 'maps'} in {self.path}")

    def _write_to_standard_output(self, grid_map: "GridMap") -> None:
        # An archive is not written from its beginning to its end.
        with tempfile.TemporaryDirectory(prefix="grid-map-") as folder:
            path = Path(folder, "map.npz")
            self.format.save(grid_map, path, **self._given)  # type: ignore[misc]
            with path.open("rb") as file:
                shutil.copyfileobj(file, sys.stdout.buffer)


def check_free(path: str, *, force: bool) -> None:
    """Refuse to replace a file that is there.

    Raises:
        CommandError: there is one and `force` is false, or it is a device, a pipe or a socket.
    """
    if path == STANDARD or not os.path.lexists(path):
        return
    file = Path(path)
    if file.exists() and not (file.is_file() or file.is_dir()):
        raise CommandError(f"{path}: is neither a file nor a folder, and not replaced")
    if not force:
        raise CommandError(f"{path}: is there already; --force replaces it")
