# SPDX-License-Identifier: BSD-3-Clause
"""Reads windows of Zarr stores, and merges maps into stores."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays._checks import Layer, Size, select_layers
from ..errors import GeometryError, GridMapError, OutOfMapError, required, short
from ..files._shared import storage_errors
from ..limits import check_cells
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..map._merge import check_frames, lines_under
from ._datasets import DIMENSIONS, geometry_of, layers_of, mirrored, open_dataset
from ._source import TILE, TiledData, Tiles, Window, common, within
from ._zarr_files import (
    VERSION,
    VERSION_KEY,
    check_local,
    is_local,
    locked,
    metadata_file,
    open_layer,
)

if TYPE_CHECKING:
    import xarray

_OPENED = 16
"""Number of stores that a process keeps open; opening a store is as slow as reading a window."""

_LARGEST_DIFFERENCE = 1e-6  # maximum relative difference between resolutions that count as equal


@dataclass(frozen=True)
class StoreSource:
    """Source that reads layers from a Zarr store; `path` is a folder or an fsspec URL."""

    path: str
    layers: tuple[str, ...]
    size: Size
    place: tuple[GridGeometry, str]
    """Geometry and reference system of the store when it was opened."""

    reads_layers_alone: ClassVar[bool] = True

    def describe(self) -> str:
        path = Path(self.path)
        if not is_local(self.path):
            return self.path
        times = [file.stat().st_mtime_ns for file in (path, *(path / name for name in self.layers))]
        return f"{path.absolute()} of {times}"

    def prepare(self) -> None:
        """Do nothing, because windows share no data."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        source = self.opened()[1].source
        # Layers are read one by one, so that an error names the layer.
        return [layer for name in names for layer in source.read(window, [name])]

    def opened(self) -> "tuple[xarray.Dataset, TiledData]":
        dataset, found = _open(self.path, _stamp(self.path))
        place = found.geometry, found.crs
        if place != self.place or not {*self.layers} <= {*found.layers}:
            raise GridMapError(f"{self.path}: the store has been replaced; open it again")
        return dataset, found


def open_store(name: str, chunks: int | None = None) -> TiledData:
    _, found = _open(name, _stamp(name))
    side = (chunks, chunks) if chunks else found.tile
    # The processes of a cluster may have another working directory.
    path = str(Path(name).absolute()) if is_local(name) else name
    source = StoreSource(path, found.layers, found.size, (found.geometry, found.crs))
    return replace(found, source=source, tile=side)


def _stamp(name: str) -> object:
    """Return a cache key that changes when the store is replaced."""
    if not is_local(name):
        return None
    with storage_errors(name, "read"):
        files = [metadata_file(Path(name)), Path(name, ".zmetadata"), Path(name, ".zattrs")]
        found = [file.stat() for file in files if file.exists()]
        return tuple((about.st_ino, about.st_mtime_ns) for about in found)


@lru_cache(maxsize=_OPENED)
def _open(name: str, stamp: object) -> "tuple[xarray.Dataset, TiledData]":  # noqa: ARG001
    with storage_errors(name, "read"):
        xarray = required("xarray", f"{name}: a Zarr store")
        required("zarr", f"{name}: a Zarr store")
        # With None, xarray would warn if a local store has no consolidated metadata.
        consolidated = Path(name, ".zmetadata").exists() if is_local(name) else None
        dataset = xarray.open_zarr(name, chunks=None, decode_times=False, consolidated=consolidated)
        if (version := dataset.attrs.get(VERSION_KEY, VERSION)) != VERSION:
            expected = f"expected a store of version {VERSION}, got {short(version)}"
            raise GridMapError(f"{expected}. Install a newer grid_map_core_py")
        layers = layers_of(dataset)
        for layer in layers:
            chunk = dataset[layer].encoding.get("chunks") or (1, 1)
            # Reading even a single cell unpacks a whole chunk.
            check_cells(f"{layer}: chunk", chunk)
        stored = dataset[layers[0]].encoding.get("chunks") if layers else None
        if stored and dataset[layers[0]].dims != DIMENSIONS:
            stored = stored[::-1]
        return dataset, open_dataset(dataset, tuple(stored or (TILE, TILE)), name)


def merge(
    tiled_map: TiledData,
    grid_map: GridMap,
    position: ArrayLike | None,
    layers: Iterable[str] | None,
) -> None:
    source = tiled_map.source
    if not isinstance(source, StoreSource):
        raise GridMapError(
            f"expected a map of a Zarr store to write to, got one of {type(source).__name__}. "
            "Write it into a store first, with to_zarr"
        )
    path = check_local(source.path)
    check_frames(tiled_map, grid_map)
    expected, found = tiled_map.resolution, grid_map.resolution
    if abs(found - expected) > _LARGEST_DIFFERENCE * expected:
        raise GeometryError(
            f"grid_map: expected cells of {expected:g} m as in the store, got {found:g} m. "
            "Resample it first, with add_data_from into a map of this resolution"
        )
    names = select_layers(grid_map, layers)
    if lacking := [name for name in names if name not in tiled_map.layers]:
        raise GridMapError(
            f"{path}: the store lacks the layers {', '.join(lacking)} of the map; it has "
            f"{', '.join(tiled_map.layers)}. The option 'layers' names those to write"
        )
    if position is not None:
        grid_map = grid_map._with({**grid_map}, grid_map.geometry.at(position))
    window, lines = _under(tiled_map, grid_map)
    with storage_errors(path, "written"), locked(path):
        for name in names:
            with storage_errors(path / name, "written"):
                _merge_layer(source, name, window, lines, grid_map[name])


def _under(tiled_map: TiledData, grid_map: GridMap) -> tuple[Window, list[NDArray[Any]]]:
    """Return the window of store cells whose centers are inside a map, and their map cells.

    The map cells are two arrays: the map row of each window row, and the map column of each window
    column.
    """
    outer, inner = tiled_map.geometry, grid_map.geometry
    border = outer.resolution
    near = outer.box(inner.corner - inner.length - border, inner.corner + border)
    window, lines = [], []
    for axis, (part, centers) in enumerate(zip(near, outer.axes_in_map_order(), strict=True)):
        found, inside = lines_under(centers[part], grid_map, axis)
        run = np.flatnonzero(inside)
        if not run.size:
            raise OutOfMapError(
                f"grid_map: no cell of it is on the store: {inner.place}; store: {outer.place}"
            )
        window.append(slice(part.start + int(run[0]), part.start + int(run[-1]) + 1))
        lines.append(found[inside])
    return (window[0], window[1]), lines


def _merge_layer(
    source: StoreSource, name: str, window: Window, lines: list[NDArray[Any]], layer: Layer
) -> None:
    dataset, _ = source.opened()
    variable, (_, ascends) = dataset[name].variable, geometry_of(dataset)
    if {"scale_factor", "add_offset"} & {*variable.encoding} or variable.dtype.kind != "f":
        raise GridMapError("expected a layer of floats to write to, got scaled integers")
    rows_first = variable.dims == DIMENSIONS

    def in_order(place: Window) -> Window:
        return place if rows_first else place[::-1]

    array = open_layer(source.path, name)
    stored = mirrored(window, source.size, ascends)
    for chunk in Tiles(array.shape, array.chunks).touching(in_order(stored)):
        place = mirrored(in_order(chunk), source.size, ascends)
        shared = common(place, window)
        rows, columns = (
            line[part] for line, part in zip(lines, within(shared, window), strict=True)
        )
        values = layer[rows[:, None], columns]
        finite = np.isfinite(values)
        if finite.any():
            cells = array[chunk]
            view = cells if rows_first else cells.T
            view = view[tuple(slice(None, None, -1 if each else None) for each in ascends)]
            np.copyto(view[within(shared, place)], values, where=finite)
            array[chunk] = cells
