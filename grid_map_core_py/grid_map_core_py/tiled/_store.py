# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Tiled maps into Zarr stores: tile by tile, under another name until all tiles are there.

A chunk of a layer is a file that is written at once or not at all. A tile is finished when the
chunks of all layers exist; a later run computes the others.
"""

import fcntl
import hashlib
import shutil
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays._checks import select_layers
from ..errors import GridMapError
from ..files._shared import check_ending, storage_errors
from ._engine import in_any_order
from ._tiled_map import Progress, TiledMap
from ._xarray import CRS_VARIABLE, DIMENSIONS, attributes, coordinates

_BEGUN = "grid_map_run"
"""Attribute of an unfinished store: what the run computes."""


def to_zarr(
    site: TiledMap,
    path: str | PathLike[str],
    *,
    layers: Iterable[str] | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> None:
    """Write a tiled map into a Zarr store; see `TiledMap.to_zarr`."""
    target = Path(path)
    check_ending(target, ".zarr")
    names = select_layers(site.layers, layers)
    site.source.prepare()
    part = target.with_name(f"{target.name}.part")
    with storage_errors(target, "written"), _alone(part):
        if target.exists() and not overwrite:
            raise GridMapError("exists already; 'overwrite' replaces it")
        run = _description(site, names)
        _begin(part, site, names, run, resume=resume)
        tiles = site.tiles
        missing = [n for n in range(len(tiles)) if not _is_complete(part, site, names, n)]
        write = _Write(site, str(part), names)
        done = len(tiles) - len(missing)
        if progress is not None:
            progress(done, len(tiles))
        for _ in in_any_order(write, missing):
            done += 1
            if progress is not None:
                progress(done, len(tiles))
        _finish(part)
        if target.exists():
            shutil.rmtree(target)
        Path(part).rename(target)


@dataclass(frozen=True)
class _Write:
    """Computes a tile and writes it."""

    site: TiledMap
    store: str
    names: Sequence[str]

    def __call__(self, number: int) -> None:
        group = _open(self.store)
        window = self.site.tiles[number]
        for name, layer in zip(self.names, self.site.source.read(window, self.names), strict=True):
            group[name][window] = layer


def _open(store: str) -> Any:
    import zarr

    return zarr.open_group(store, mode="r+")


def _create(group: Any, name: str, shape: Sequence[int], chunks: Sequence[int]) -> None:
    """Add a layer to a store: chunks have the memory order of layers, and exist even if empty."""
    import numcodecs

    packed = numcodecs.Blosc("lz4", 1, numcodecs.Blosc.SHUFFLE)
    common: dict[str, Any] = {"shape": tuple(shape), "chunks": tuple(chunks), "dtype": "<f4"}
    common |= {"fill_value": np.nan, "order": "F"}
    if hasattr(group, "create_array"):
        config = {"write_empty_chunks": True}
        array = group.create_array(name, compressors=packed, config=config, **common)
    else:  # Zarr 2
        array = group.create_dataset(name, compressor=packed, write_empty_chunks=True, **common)
    array.attrs["_ARRAY_DIMENSIONS"] = [*DIMENSIONS]


def _begin(
    part: Path, site: TiledMap, names: Sequence[str], run: dict[str, Any], *, resume: bool
) -> None:
    """Make the unfinished store, or check that the one that exists belongs to this run."""
    import zarr

    if (part / ".zgroup").exists():
        found = dict(zarr.open_group(str(part), mode="r").attrs).get(_BEGUN)
        if resume and found is not None:
            different = [key for key in run if found.get(key) != run[key]]
            if different:
                raise GridMapError(
                    f"{part.name} was begun with another {', '.join(different)}; remove it, or "
                    "resume with the same input, filters and tiles"
                )
            return
        if found is not None and not resume:
            raise GridMapError(
                f"{part.name} is left from a run that did not finish; 'resume' continues it; "
                "remove it to begin anew"
            )
    options: dict[str, Any] = {"mode": "w", "zarr_format": 2}
    if zarr.__version__.startswith("2."):
        del options["zarr_format"]
    group = zarr.open_group(str(part), **options)
    for name in names:
        _create(group, name, site.size, site.tile)
    for name, (_, values, about) in coordinates(site.geometry).items():
        array = group.create(name=name, shape=values.shape, dtype="<f8", chunks=values.shape)
        array[:] = values
        array.attrs.update(about | {"_ARRAY_DIMENSIONS": [name]})
    if site.crs:
        array = group.create(name=CRS_VARIABLE, shape=(), dtype="<i4", chunks=())
        array.attrs.update(_grid_mapping(site.crs) | {"_ARRAY_DIMENSIONS": []})
        for name in names:
            group[name].attrs["grid_mapping"] = CRS_VARIABLE
    basic = [name for name in site.basic_layers if name in names]
    about = attributes(site.geometry, site.frame_id, site.timestamp, basic)
    group.attrs.update(about | {_BEGUN: run})


def _grid_mapping(crs: str) -> dict[str, str]:
    return {"crs_wkt": crs, "spatial_ref": crs}


def _is_complete(part: Path, site: TiledMap, names: Sequence[str], number: int) -> bool:
    row, column = divmod(number, site.tiles.counts[1])
    return all((part / name / f"{row}.{column}").exists() for name in names)


def _finish(part: Path) -> None:
    """Write the metadata of a complete store into one place, without those of the run."""
    import zarr

    group = zarr.open_group(str(part), mode="r+")
    del group.attrs[_BEGUN]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(str(part))


def _description(site: TiledMap, names: Sequence[str]) -> dict[str, Any]:
    """Return what must be the same for a later run to continue this one."""
    source = hashlib.sha256(site.source.describe().encode()).hexdigest()
    tiles = [*site.size, *site.tile]
    return {"input and filters": source, "layers": [*names], "tiles": tiles}


@contextmanager
def _alone(part: Path) -> Iterator[None]:
    """Let one process at a time write an unfinished store."""
    lock = part.with_name(f"{part.name}.lock")
    lock.parent.mkdir(parents=True, exist_ok=True)
    with lock.open("w") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise GridMapError("another process is writing it") from None
        yield
        lock.unlink(missing_ok=True)
