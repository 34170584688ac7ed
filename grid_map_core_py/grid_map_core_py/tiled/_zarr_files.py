# SPDX-License-Identifier: BSD-3-Clause
"""Writes tiled maps to new Zarr stores tile by tile, and manages store files and locks.

Stores use Zarr format 2, which zarr-python 2 and 3 can write. Each chunk file contains a block of a
layer in Fortran order. If a chunk has no file, its cells are NaN. zarr-python writes a chunk to a
temporary file and then renames the file; some versions, such as 3.1.0, write in place.

An unfinished store is a folder whose name ends in `.part`. A tile is complete when its chunks exist
in all layers. A resumed run computes only the missing tiles. Finally, the folder is renamed.
"""

import errno
import fcntl
import json
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from os import PathLike
from pathlib import Path
from typing import IO, Any

import numpy as np

from .._arrays._checks import is_name
from .._unfinished import notes
from ..errors import GridMapError, required, short
from ..files._shared import check_ending, new_folder, replace_folder, storage_errors
from ._datasets import CRS_VARIABLE, DIMENSIONS, attributes, coordinates, grid_mapping
from ._engine import in_any_order
from ._source import Progress, TiledData

VERSION_KEY = "grid_map_version"
VERSION = 1
"""Version of the store format, increased when older releases cannot read new stores correctly."""

_RUN = ".run.json"
"""File that describes the run in an unfinished store; the writing process locks this file."""

_NEAR = 4  # side of the squares of neighboring tiles that are computed one after the other [tiles]


def create_store(path: str | PathLike[str], tiled_map: TiledData, names: Sequence[str]) -> Path:
    target = check_local(path)
    check_ending(target, ".zarr")
    with storage_errors(target, "written"), new_folder(target, _refuse) as folder:
        create_layers(folder, tiled_map, names)
    return target


def _refuse(path: Path) -> None:
    raise GridMapError(f"{path}: already exists")


def to_zarr(
    tiled_map: TiledData,
    path: str | PathLike[str],
    names: Sequence[str],
    progress: Progress,
    *,
    resume: bool,
    overwrite: bool,
) -> None:
    target = check_local(path)
    check_ending(target, ".zarr")
    if target.is_symlink():
        target = target.resolve()
    part = target.with_name(f"{target.name}.part")
    with storage_errors(target, "written"):
        if target.exists():
            if not overwrite:
                raise GridMapError("already exists; 'overwrite' replaces it")
            # This raises an error if the target is not a store, so that only stores are replaced.
            metadata_file(target)
        # A run is resumed only if all these entries are equal.
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
                # This file is written last, because Zarr warns about unknown files.
                (folder / _RUN).write_text(json.dumps(run), encoding="utf-8")
        note = f"{part} keeps the finished tiles; --resume continues the run"
        with _locked(part):
            notes.add(note)
            _compute(tiled_map, part, names, progress)
            notes.discard(note)
            # Killed workers leave partial files behind.
            for leftover in part.glob("*/*.partial"):
                leftover.unlink()
            replace_folder(part, target)
        (target / _RUN).unlink()


@contextmanager
def _locked(part: Path) -> Iterator[IO[str]]:
    """Lock an unfinished store for this process, and yield the open run file."""
    with (part / _RUN).open("r+") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise GridMapError("another process is writing it") from None
        yield stream


def _compute(tiled_map: TiledData, part: Path, names: Sequence[str], progress: Progress) -> None:
    tiles, columns = tiled_map.tiles, tiled_map.tiles.counts[1]
    chunks = [{file.name for file in (part / name).iterdir()} for name in names]
    places = {n: divmod(n, columns) for n in range(len(tiles))}
    missing = [
        n for n, (row, column) in places.items() if any(f"{row}.{column}" not in c for c in chunks)
    ]
    # Neighboring tiles are computed one after the other, so that shared inputs stay in memory.
    missing.sort(key=lambda n: [line // _NEAR for line in places[n]])
    finished = len(tiles) - len(missing)
    progress(finished, len(tiles))
    write = _Write(tiled_map, str(part.absolute()), names)
    for done, _ in enumerate(in_any_order(write, missing), finished + 1):
        progress(done, len(tiles))


@dataclass(frozen=True)
class _Write:
    tiled_map: TiledData
    store: str
    names: Sequence[str]

    def __call__(self, number: int) -> None:
        window = self.tiled_map.tiles[number]
        try:
            layers = self.tiled_map.source.read(window, self.names)
        except GridMapError as error:
            place = ", ".join(f"{part.start}:{part.stop}" for part in window)
            raise GridMapError(f"cells [{place}]: {error}") from error
        for name, layer in zip(self.names, layers, strict=True):
            with storage_errors(Path(self.store, name), "written"):
                self._arrays[name][window] = layer

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        # A tile is complete when all its chunks exist, so even chunks of NaN must be written.
        return {name: open_layer(self.store, name, empty_chunks=True) for name in self.names}


# --- files of a store -----------------------------------------------------------------------------


def is_local(name: str) -> bool:
    """Return whether a store name is a local path, not an fsspec URL."""
    return "://" not in name and "::" not in name


def check_local(path: str | PathLike[str]) -> Path:
    """Return the path of a store to write; raise `GridMapError` unless the path is local."""
    name = os.fspath(path)
    if not is_local(name):
        raise GridMapError(
            f"path: expected a folder of this machine, got {short(name)}. "
            "Write a local store and upload it"
        )
    return Path(name)


def create_layers(path: Path, tiled_map: TiledData, names: Sequence[str]) -> None:
    """Create a store for the layers `names` in an empty folder, without writing chunks."""
    zarr = required("zarr", f"{path}: a Zarr store")
    blosc = required("numcodecs", "a Zarr store").Blosc
    taken = (*DIMENSIONS, CRS_VARIABLE)
    for name in names:
        if not is_name(name) or name.startswith((".", "__")) or {*name} & {*"/\\"} or name in taken:
            raise GridMapError(
                "layers: expected names that a Zarr store can hold (without / and \\, not "
                f"beginning with . or __, none of {', '.join(taken)}), got {short(name)}"
            )
    geometry, crs = tiled_map.geometry, tiled_map.crs
    version = {} if _is_zarr_2(zarr) else {"zarr_format": 2}
    group = zarr.open_group(str(path), mode="a", **version)

    def create(name: str, dimensions: Sequence[str], about: dict[str, Any], **options: Any) -> Any:
        if hasattr(group, "create_array"):
            options["compressors"] = options.pop("compressor", None)
            array = group.create_array(name, **options)
        else:
            array = group.create_dataset(name, **{"compressor": None} | options)
        # In zarr-python 3, `update` would write the file again for each attribute.
        array.attrs.put(about | {"_ARRAY_DIMENSIONS": [*dimensions]})
        return array

    # Readers convert the variable to a coordinate, which rioxarray expects.
    about_crs = {"grid_mapping": CRS_VARIABLE, "coordinates": CRS_VARIABLE} if crs else {}
    form = {"dtype": "<f4", "shape": geometry.size, "chunks": tuple(tiled_map.tile), "order": "F"}
    packing = {"compressor": blosc("lz4", 1, blosc.SHUFFLE), "fill_value": np.nan}
    for name in names:
        create(name, DIMENSIONS, about_crs, **form, **packing)
    for name, (_, values, about) in coordinates(geometry, tiled_map.origin).items():
        # xarray reads values that equal the fill value as NaN.
        options = {"shape": values.shape, "chunks": values.shape, "fill_value": np.nan}
        create(name, [name], about, dtype="<f8", **options)[:] = values
    if crs:
        create(CRS_VARIABLE, [], grid_mapping(crs), dtype="<i4", shape=(), chunks=())
    group.attrs.put(attributes(tiled_map, names) | {VERSION_KEY: VERSION})
    # Readers then need only one file for the metadata of all layers.
    zarr.consolidate_metadata(str(path))


def _is_zarr_2(zarr: Any) -> bool:
    return bool(zarr.__version__.startswith("2."))


def open_layer(store: str, name: str, *, empty_chunks: bool = False) -> Any:
    """Open a layer's Zarr array for writing; `empty_chunks` also writes chunks of only NaN."""
    zarr = required("zarr", f"{store}: a Zarr store")
    if Path(store, name).is_symlink():
        raise GridMapError("expected a folder, got a link. Copy the layer into the store first")
    options = {"write_empty_chunks": empty_chunks}
    if _is_zarr_2(zarr):
        return zarr.open_array(store, path=name, mode="r+", **options)
    return zarr.open_array(store, path=name, mode="r+").with_config(options)


def metadata_file(store: Path) -> Path:
    """Return the metadata file of a store, which does not change when chunks are written."""
    if not store.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(store))
    # Zarr formats 2 and 3.
    for name in (".zgroup", "zarr.json"):
        if (store / name).is_file():
            return store / name
    raise GridMapError(f"{store}: expected a Zarr store, got a folder without .zgroup")


@contextmanager
def locked(store: Path) -> Iterator[None]:
    """Lock a store; other threads and processes wait until this context exits."""
    with metadata_file(store).open("r+") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)
        yield
        # By the new modification time, later runs detect that the content has changed.
        os.utime(store)
