# SPDX-License-Identifier: BSD-3-Clause
"""Tiled maps into Zarr stores: tile by tile, under another name until all tiles are there.

A chunk of a layer is a file that is written at once or not at all. A tile is finished when the
chunks of all layers exist; a later run computes the others.
"""

import fcntl
import hashlib
import json
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

from .._arrays._checks import select_layers
from .._unfinished import remove
from ..errors import GridMapError
from ..files._atomic import new_file, new_folder, replace_folder
from ..files._shared import check_ending
from ..map._geometry import GridGeometry
from ..plugins import check
from ._engine import in_any_order
from ._source import tile_name
from ._stores import open_store
from ._tiled_map import Progress, TiledMap
from ._zarr import (
    check_local,
    check_names,
    consolidate,
    create_group,
    is_same,
    locked,
    metadata_file,
    open_layer,
    store_errors,
)

_RUN = ".run.json"
"""File in an unfinished store: what the run computes."""

_LOCK = ".lock"
"""File in an unfinished store, which the process that writes it has locked."""

_NEAR = 4
"""Tiles along the sides of a square of tiles that are computed one after the other."""

_TRIES, _PAUSE = 50, 0.02
"""How often a folder is removed that is not empty yet, and the time between [s]."""


def to_zarr(
    site: TiledMap,
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
    check_names(names)
    part = target.with_name(f"{target.name}.part")
    with store_errors(target, "written"):
        _check_target(target, overwrite=overwrite)
        with _alone(part):
            run = _description(site, names)
            begun = _is_begun(part, run, resume=resume)
            site.source.prepare()
            if not begun:
                _begin(part, site, names, run)
            _compute(site, part, names, progress or _silent)
            _check_target(target, overwrite=overwrite)
            _put_in_place(part, target)


def _silent(done: int, total: int) -> None:
    """Show no progress."""


def _check_target(target: Path, *, overwrite: bool) -> None:
    """Refuse to replace a store without `overwrite`, and what is no store."""
    if target.exists():
        if not overwrite:
            raise GridMapError("exists already; 'overwrite' replaces it")
        metadata_file(target)


def _compute(site: TiledMap, part: Path, names: Sequence[str], progress: Progress) -> None:
    """Compute the tiles that are not in the unfinished store."""
    tiles, columns = site.tiles, site.tiles.counts[1]
    chunks = [_chunks_of(part / name) for name in names]
    finished = set.intersection(*chunks) if chunks else set()
    places = {n: divmod(n, columns) for n in range(len(tiles))}
    missing = [n for n, place in places.items() if "{}.{}".format(*place) not in finished]
    # Tiles side by side share blocks of their borders, which the process that has them keeps.
    missing.sort(key=lambda n: [line // _NEAR for line in places[n]])
    done = len(tiles) - len(missing)
    progress(done, len(tiles))
    for _ in in_any_order(_Write(site, str(part.absolute()), names), missing):
        done += 1
        progress(done, len(tiles))


def _chunks_of(layer: Path) -> set[str]:
    """Return the names of the chunks of a layer."""
    with os.scandir(layer) as files:
        return {file.name for file in files if file.name[0].isdecimal()}


def _put_in_place(part: Path, target: Path) -> None:
    """Give a complete store its name."""
    # Workers that were killed leave files that they had begun.
    for leftover in part.glob("*/*.partial"):
        leftover.unlink()
    if target.exists():
        # Processes that merge maps into the old store have finished, or find the new one.
        with locked(target):
            replace_folder(part, target)
        shutil.rmtree(part, ignore_errors=True)
    else:
        part.rename(target)
    for name in (_RUN, _LOCK):
        (target / name).unlink()


def create_store(
    path: str | PathLike[str],
    geometry: GridGeometry,
    layers: Sequence[str],
    *,
    chunks: int,
    **about: Any,
) -> TiledMap:
    """Make a store without data; see `TiledMap.create`."""
    target = check_local(path)
    check_ending(target, ".zarr")
    check(chunks >= 1, "chunks", "a number of cells", chunks)
    select_layers(layers, about["basic_layers"])
    with store_errors(target, "written"), new_folder(target, _refuse) as folder:
        create_group(folder, geometry, layers, (chunks, chunks), **about)
        consolidate(folder)
    return open_store(str(target), chunks)


def _refuse(path: Path) -> None:
    raise GridMapError(f"{path}: exists already")


@dataclass(frozen=True)
class _Write:
    """Computes a tile and writes it."""

    site: TiledMap
    store: str
    names: Sequence[str]

    def __call__(self, number: int) -> None:
        window = self.site.tiles[number]
        try:
            layers = self.site.source.read(window, self.names)
        except GridMapError as error:
            raise GridMapError(f"{tile_name(window)}: {error}") from error
        for name, layer in zip(self.names, layers, strict=True):
            with store_errors(Path(self.store, name), "written"):
                self._arrays[name][window] = layer

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        # A tile is finished when its chunks exist.
        return {name: open_layer(self.store, name, empty_chunks=True) for name in self.names}


def _is_begun(part: Path, run: dict[str, Any], *, resume: bool) -> bool:
    """Return whether the unfinished store is there, and refuse that of another run."""
    file = part / _RUN
    if not file.exists():
        return False
    found = json.loads(file.read_text(encoding="utf-8"))
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
    return True


def _begin(part: Path, site: TiledMap, names: Sequence[str], run: dict[str, Any]) -> None:
    """Make the unfinished store."""
    # A run that was killed before this leaves a part of the metadata.
    for old in part.iterdir():
        if old.name != _LOCK:
            remove(old)
    # Zarr warns of files that are not its own.
    store = part / "new"
    store.mkdir()
    create_group(
        store,
        site.geometry,
        names,
        site.tile,
        frame_id=site.frame_id,
        timestamp=site.timestamp,
        basic_layers=[name for name in site.basic_layers if name in names],
        crs=site.crs,
    )
    consolidate(store)
    for file in store.iterdir():
        file.rename(part / file.name)
    store.rmdir()
    with new_file(part / _RUN) as file:
        file.write_text(json.dumps(run), encoding="utf-8")


def _description(site: TiledMap, names: Sequence[str]) -> dict[str, Any]:
    """Return what must be the same for a later run to continue this one."""
    source = hashlib.sha256(site.source.describe().encode()).hexdigest()
    tiles = [*site.size, *site.tile]
    place = [site.resolution, *site.position.tolist(), site.crs]
    return {"input and filters": source, "layers": [*names], "tiles": tiles, "place": place}


@contextmanager
def _alone(part: Path) -> Iterator[None]:
    """Let one process at a time write an unfinished store."""
    lock = part / _LOCK
    while True:
        part.mkdir(exist_ok=True)
        with lock.open("w") as stream:
            try:
                fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise GridMapError("another process is writing it") from None
            # That process may have finished in between.
            if not is_same(stream, lock):
                continue
            try:
                yield
            finally:
                if not (part / _RUN).exists() and is_same(stream, lock):
                    _remove(part)
            return


def _remove(folder: Path) -> None:
    """Remove a folder, into which threads of Zarr may still write after an error."""
    for _ in range(_TRIES):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return
        time.sleep(_PAUSE)
