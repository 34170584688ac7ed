# SPDX-License-Identifier: BSD-3-Clause
"""Computes tiled maps into new Zarr stores, tile by tile.

A store gets its name when all its tiles are there; until then it is a folder beside it, whose name
ends in `.part`. Each chunk of a layer is a file that is written atomically. A tile is finished when
the chunks of all layers exist, so that a later run computes only the others.
"""

import fcntl
import json
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from os import PathLike
from pathlib import Path
from typing import IO, Any

from ..errors import GridMapError
from ..files._atomic import new_folder
from ..files._shared import check_ending
from ._engine import in_any_order
from ._source import Progress, TiledData, data_errors, tile_name
from ._zarr_layout import check_local, create_layers, metadata_file, open_layer

_RUN = ".run.json"
"""File in an unfinished store: says what the run computes, and is locked by its process."""

_NEAR = 4
"""Tiles along the sides of a square of tiles that are computed one after the other."""


def create_store(path: str | PathLike[str], tiled_map: TiledData, names: Sequence[str]) -> Path:
    """Make a store without data, and return its path; see `TiledMap.create`."""
    target = check_local(path)
    check_ending(target, ".zarr")
    with data_errors(target, "written"), new_folder(target, _refuse) as folder:
        create_layers(folder, tiled_map, names)
    return target


def _refuse(path: Path) -> None:
    raise GridMapError(f"{path}: exists already")


def to_zarr(
    tiled_map: TiledData,
    path: str | PathLike[str],
    names: Sequence[str],
    progress: Progress | None,
    *,
    resume: bool,
    overwrite: bool,
) -> None:
    """Write a tiled map into a Zarr store; see `TiledMap.to_zarr`."""
    target = check_local(path)
    check_ending(target, ".zarr")
    part = target.with_name(f"{target.name}.part")
    with data_errors(target, "written"):
        if target.exists():
            if not overwrite:
                raise GridMapError("exists already; 'overwrite' replaces it")
            # Raises an error if the folder is no store.
            metadata_file(target)
        # All that must be the same for a later run to continue this one.
        run = {
            "input and filters": sha256(tiled_map.source.describe().encode()).hexdigest(),
            "layers": [*names],
            "tiles": [*tiled_map.size, *tiled_map.tile],
            "place": [
                *(tiled_map.resolution, *tiled_map.position.tolist()),
                *(tiled_map.crs, *tiled_map.origin),
            ],
        }
        if part.exists():
            with _locked(part) as stream:
                found = json.load(stream)
            if not resume:
                raise GridMapError(
                    f"{part.name} is left from a run that did not finish; "
                    "'resume' (--resume) continues it; remove it to begin anew"
                )
            if different := [key for key in run if found.get(key) != run[key]]:
                raise GridMapError(
                    f"{part.name} was begun with another {', '.join(different)}; remove it, or "
                    "resume with the same input, filters and tiles"
                )
        tiled_map.source.prepare()
        if not part.exists():
            with new_folder(part, _refuse) as folder:
                create_layers(folder, tiled_map, names)
                # Zarr warns of files that are not its own.
                (folder / _RUN).write_text(json.dumps(run), encoding="utf-8")
        with _locked(part):
            _compute(tiled_map, part, names, progress)
            # Workers that were killed leave files that they had begun.
            for leftover in part.glob("*/*.partial"):
                leftover.unlink()
            if target.exists():
                old = target.with_name(f"{target.name}.old")
                target.rename(old)
                part.rename(target)
                shutil.rmtree(old)
            else:
                part.rename(target)
        (target / _RUN).unlink()


@contextmanager
def _locked(part: Path) -> Iterator[IO[str]]:
    """Let one process at a time compute an unfinished store; yield the description of its run."""
    with (part / _RUN).open("r+") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise GridMapError("another process is writing it") from None
        yield stream


def _compute(
    tiled_map: TiledData, part: Path, names: Sequence[str], progress: Progress | None
) -> None:
    """Compute the tiles that are not in the unfinished store."""
    tiles, columns = tiled_map.tiles, tiled_map.tiles.counts[1]
    chunks = [{file.name for file in (part / name).iterdir()} for name in names]
    places = {n: divmod(n, columns) for n in range(len(tiles))}
    missing = [
        n for n, (row, column) in places.items() if any(f"{row}.{column}" not in c for c in chunks)
    ]
    # Tiles side by side share blocks of their borders, which the process that has them keeps.
    missing.sort(key=lambda n: [line // _NEAR for line in places[n]])
    done = len(tiles) - len(missing)
    if progress is not None:
        progress(done, len(tiles))
    for _ in in_any_order(_Write(tiled_map, str(part.absolute()), names), missing):
        done += 1
        if progress is not None:
            progress(done, len(tiles))


@dataclass(frozen=True)
class _Write:
    """Computes a tile and writes it."""

    tiled_map: TiledData
    store: str
    names: Sequence[str]

    def __call__(self, number: int) -> None:
        window = self.tiled_map.tiles[number]
        try:
            layers = self.tiled_map.source.read(window, self.names)
        except GridMapError as error:
            raise GridMapError(f"{tile_name(window)}: {error}") from error
        for name, layer in zip(self.names, layers, strict=True):
            with data_errors(Path(self.store, name), "written"):
                self._arrays[name][window] = layer

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        # A tile is finished when its chunks exist, so those without finite cells are written, too.
        return {name: open_layer(self.store, name, empty_chunks=True) for name in self.names}
