# SPDX-License-Identifier: BSD-3-Clause
"""Zarr stores as sources of layers."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from .._arrays._checks import Layer, Size
from ..errors import GridMapError, required
from ._datasets import DIMENSIONS, layers_of
from ._source import TILE, Tiles, Window, tile_name
from ._tiled_map import TiledMap
from ._xarray import DatasetSource, open_dataset
from ._zarr import check_layers, metadata_file, store_errors

if TYPE_CHECKING:
    import xarray

_REMEDY = "pip install 'grid_map_core_py[tiled]'"

_OPENED = 16
"""Stores that a process keeps open: opening one takes as long as reading a window."""


@dataclass(frozen=True)
class StoreSource:
    """Layers in a Zarr store, which each process opens when it reads.

    Args:
        path: the folder of the store, or its address.
        layers: names of the layers.
        size: rows and columns.
    """

    path: str
    layers: tuple[str, ...]
    size: Size

    reads_layers_alone: ClassVar[bool] = True
    """Several layers take as long together as one after the other."""

    def describe(self) -> str:
        """Return the path, and the times of the last changes."""
        path = Path(self.path)
        if not is_local(self.path):
            return self.path
        changed = [metadata_file(path), *(path / name for name in self.layers)]
        times = [file.stat().st_mtime_ns for file in changed if file.exists()]
        return f"{path.absolute()} of {times}"

    def prepare(self) -> None:
        """Do nothing: windows have nothing in common."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        """Return the named layers of a window, as `Source.read` describes it."""
        source = self._opened()
        try:
            return source.read(window, names)
        except GridMapError as error:
            raise self._located(error, source, window, names) from error

    def opened_to_write(self, name: str) -> tuple[DatasetSource, bool]:
        """Return the layers as xarray reads them, and whether x is the first dimension of one.

        Raises:
            GridMapError: its values are encoded, so that floats cannot be written.
        """
        source = self._opened()
        variable = source.dataset[name].variable
        if {"scale_factor", "add_offset"} & {*variable.encoding} or variable.dtype.kind != "f":
            expected = "a layer of floats to write to"
            raise GridMapError(f"{self.path}: {name}: expected {expected}, got scaled integers")
        return source, variable.dims == DIMENSIONS

    def _opened(self) -> DatasetSource:
        source: DatasetSource = _open(self.path, _stamp(self.path)).source  # type: ignore[assignment]
        rows_columns = tuple(source.dataset.sizes[name] for name in DIMENSIONS)
        if rows_columns != self.size or not {*self.layers} <= {*source.layers}:
            raise GridMapError(f"{self.path}: the store has been replaced; open it again")
        return source

    def _located(
        self, error: GridMapError, source: DatasetSource, window: Window, names: Sequence[str]
    ) -> GridMapError:
        """Return an error that names the chunk that cannot be read."""
        for name in names:
            chunks = source.dataset[name].encoding.get("chunks")
            side = chunks if source.dataset[name].dims == DIMENSIONS else chunks and chunks[::-1]
            for tile in Tiles(self.size, side).touching(window) if side else ():
                try:
                    source.read(tile, [name])
                except GridMapError as found:
                    text = str(found).replace(f"{self.path}: ", "")
                    return GridMapError(f"{self.path}: {name}, chunk of {tile_name(tile)}: {text}")
        return error


def open_store(name: str, chunks: int | None) -> TiledMap:
    """Return the tiled map of a store; see `open_map`."""
    site = _open(name, _stamp(name))
    source: DatasetSource = site.source  # type: ignore[assignment]
    side = (chunks, chunks) if chunks else site.tile
    # Processes of a cluster may have another working directory.
    path = str(Path(name).absolute()) if is_local(name) else name
    return replace(site, source=StoreSource(path, source.layers, site.size), tile=side)


def is_local(name: str) -> bool:
    """Return whether a store is a folder, and not at an address of fsspec."""
    return "://" not in name and "::" not in name


def _stamp(name: str) -> object:
    """Return a value that changes when a store is replaced by another one."""
    if not is_local(name):
        return None
    with store_errors(name, "read"):
        found = [metadata_file(Path(name)).stat().st_ino]
        for file in (".zmetadata", ".zattrs"):
            with suppress(FileNotFoundError):
                about = Path(name, file).stat()
                found += [about.st_ino, about.st_mtime_ns]
        return tuple(found)


@lru_cache(maxsize=_OPENED)
def _open(name: str, stamp: object) -> TiledMap:  # noqa: ARG001
    with store_errors(name, "read"):
        dataset = _dataset(name)
        layers = layers_of(dataset)
        stored = dataset[layers[0]].encoding.get("chunks") if layers else None
        if stored and dataset[layers[0]].dims != DIMENSIONS:
            stored = stored[::-1]
        side = (stored[0], stored[1]) if stored else (TILE, TILE)
        return open_dataset(dataset, side, name)


def _dataset(name: str) -> "xarray.Dataset":
    xarray = required("xarray", f"{name}: a Zarr store", _REMEDY)
    required("zarr", f"{name}: a Zarr store", _REMEDY)
    options: dict[str, Any] = {"chunks": None, "decode_times": False}
    # Without the choice, xarray warns of stores without metadata in one place.
    if is_local(name):
        consolidated = Path(name, ".zmetadata").exists()
        if not consolidated:
            check_layers(Path(name))
        return xarray.open_zarr(name, consolidated=consolidated, **options)  # type: ignore[no-any-return]
    with suppress(KeyError, ValueError):
        return xarray.open_zarr(name, consolidated=True, **options)  # type: ignore[no-any-return]
    return xarray.open_zarr(name, consolidated=False, **options)  # type: ignore[no-any-return]
