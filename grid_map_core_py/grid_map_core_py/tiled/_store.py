# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Tiled maps into Zarr stores: tile by tile, under another name until all tiles are there.

A chunk of a layer is a file that is written at once or not at all. A tile is finished when the
chunks of all layers exist; a later run computes the others.
"""

import fcntl
import hashlib
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from ..arrays._checks import select_layers
from ..errors import GridMapError
from ..files._atomic import new_folder
from ..files._shared import check_ending
from ..map._geometry import GridGeometry
from ..plugins import check
from ._engine import in_any_order
from ._stores import open_store
from ._tiled_map import Progress, TiledMap
from ._zarr import check_local, check_names, consolidate, create_group, open_layer, store_errors

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
    target = check_local(path)
    check_ending(target, ".zarr")
    names = select_layers(site.layers, layers)
    check_names(names)
    site.source.prepare()
    part = target.with_name(f"{target.name}.part")
    with store_errors(target, "written"), _alone(part):
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
        for name, layer in zip(self.names, self.site.source.read(window, self.names), strict=True):
            # A tile is finished when its chunks exist.
            open_layer(self.store, name, empty_chunks=True)[window] = layer


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
    create_group(
        part,
        site.geometry,
        names,
        site.tile,
        frame_id=site.frame_id,
        timestamp=site.timestamp,
        basic_layers=[name for name in site.basic_layers if name in names],
        crs=site.crs,
    ).attrs[_BEGUN] = run


def _is_complete(part: Path, site: TiledMap, names: Sequence[str], number: int) -> bool:
    row, column = divmod(number, site.tiles.counts[1])
    return all((part / name / f"{row}.{column}").exists() for name in names)


def _finish(part: Path) -> None:
    """Write the metadata of a complete store into one place, without those of the run."""
    import zarr

    group = zarr.open_group(str(part), mode="r+")
    del group.attrs[_BEGUN]
    consolidate(part)


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
