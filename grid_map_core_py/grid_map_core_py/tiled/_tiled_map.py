# SPDX-License-Identifier: BSD-3-Clause
"""Maps of any size, and the accessor `grid_map` of datasets of xarray."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from os import PathLike
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Layer, Positions, as_array, as_names, as_positions, select_layers
from ..errors import ConfigError, GeometryError, GridMapError, required, short
from ..limits import check_cells
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..map._interpolation import REACH, Interpolation, Surface, check_inside, method_of
from ..plugins import check
from ._datasets import (
    DIMENSIONS,
    REMEDY,
    as_dataset,
    geometry_of,
    layers_of,
    mirrored,
    open_dataset,
    origin_of,
    remember,
    to_dataset,
    to_lazy_dataset,
    turned,
)
from ._engine import in_any_order
from ._source import Progress, TiledData, widened
from ._zarr_files import create_store, to_zarr
from ._zarr_source import merge, open_store

if TYPE_CHECKING:
    import xarray

T = TypeVar("T")


class Chain(Protocol):
    """Filters for maps and tiled maps: `FilterChain` of grid_map_filters_py."""

    @property
    def on_tiles(self) -> Callable[..., Any]:
        """Function of a `TiledMap` and options that returns a source with `basic_layers`."""

    def __call__(self, grid_map: GridMap) -> GridMap:
        """Return the filtered map."""


@dataclass(frozen=True, eq=False)
class TiledMap(TiledData):
    """Map of any size whose layers are read, or computed, window by window.

    `open_map` makes one. It is immutable, except for `write`, and can be pickled like its source.

    Args:
        source: where the layers come from.
        geometry: size, resolution and position, in the frame.
        tile: rows and columns of a tile.
        frame_id: frame of the map.
        timestamp: time [ns].
        basic_layers: see `GridMap.basic_layers`.
        crs: coordinate reference system, as text; empty if unknown.
        origin: coordinates of the origin of the frame in the reference system [m].
    """

    @classmethod
    def create(
        cls,
        path: str | PathLike[str],
        geometry: GridGeometry,
        layers: Iterable[str],
        *,
        chunks: int = 1024,
        basic_layers: Iterable[str] = (),
        frame_id: str = "map",
        timestamp: int = 0,
        crs: str = "",
    ) -> TiledMap:
        """Create an empty Zarr store, to be filled with `write`, and return its map.

        The store takes a few kilobytes, whatever its size. A chunk uses disk space only once it is
        written; until then its cells are NaN.

        Args:
            path: the folder of the store, which must not exist.
            geometry: size, resolution and position.
            layers: names of the layers.
            chunks: side of a chunk [cells].
            basic_layers, frame_id, timestamp: see `GridMap`.
            crs: see `TiledMap`.
        """
        check(chunks >= 1, "chunks", "a number of cells", chunks)
        names = as_names(layers)
        basic = select_layers(names, basic_layers)
        no_source: Any = None
        empty = cls(no_source, geometry, (chunks, chunks), frame_id, timestamp, basic, crs)
        return cls(**vars(open_store(str(create_store(path, empty, names)), chunks)))

    def get_block(
        self, rows: slice, columns: slice, layers: Iterable[str] | None = None
    ) -> GridMap:
        """Return a rectangle of cells as a map in memory.

        Args:
            rows, columns: slices in map order, with a start and a stop on the map.
            layers: names of the layers to read; None means all.

        Raises:
            LayerNotFoundError: a layer does not exist.
            LimitError: the block has more cells than the limits allow.
            GridMapError: the layers cannot be read or computed.
        """
        names = select_layers(self.layers, layers)
        window = rows, columns
        is_whole = window == (slice(0, self.size[0]), slice(0, self.size[1]))
        # The geometry of a part has rounding errors.
        geometry = self.geometry if is_whole else self.geometry.cropped(*window)
        check_cells("map", geometry.size, len(names))
        self.source.prepare()
        return self._map(geometry, names, self.source.read(window, names))

    def _map(self, geometry: GridGeometry, names: Sequence[str], layers: list[Layer]) -> GridMap:
        """Return a map with the frame and time of this one, which adopts the layers."""
        empty = GridMap.from_geometry(geometry, frame_id=self.frame_id, timestamp=self.timestamp)
        grid_map = empty.with_layers(dict(zip(names, layers, strict=True)))
        grid_map.basic_layers = [name for name in self.basic_layers if name in names]
        return grid_map

    def get_submap(
        self, position: ArrayLike, length: ArrayLike, layers: Iterable[str] | None = None
    ) -> GridMap:
        """Return the map of a rectangle; only the chunks under it are read.

        The cells are those of `GridMap.get_submap`.

        Args:
            position: (2,) center of the rectangle [m].
            length: (2,) its sides [m].
            layers: names of the layers to read; None means all.

        Raises:
            OutOfMapError: the rectangle does not overlap the map.
        """
        return self.get_block(*self.geometry.overlapped(position, length), layers)

    def to_map(self, layers: Iterable[str] | None = None) -> GridMap:
        """Return the whole map, if the limits allow its size; see `get_block`."""
        rows, columns = self.size
        return self.get_block(slice(0, rows), slice(0, columns), layers)

    def at_position(
        self,
        layer: str,
        positions: ArrayLike,
        interpolation: Interpolation | str = Interpolation.NEAREST,
    ) -> float | Positions:
        """Return the values of a layer at positions; only cells around them are read.

        The values equal those of `GridMap.at_position`, also at the borders of tiles. The Dask
        scheduler of the program reads the tiles.

        Args:
            layer: name of the layer.
            positions: (2,) or (N, 2) x, y [m].
            interpolation: the method, or its value as a string such as "linear".

        Returns:
            A float for one position, else (N,) float64.

        Raises:
            OutOfMapError: a position is NaN or not on the map.
        """
        select_layers(self.layers, (layer,))
        method, points = method_of(interpolation), as_positions(positions)
        flat = points.reshape(-1, 2)
        check_inside(self.geometry, flat)
        cells, _ = self.geometry.cells_at(flat)
        tiles = cells[0] // self.tile[0] * self.tiles.counts[1] + cells[1] // self.tile[1]
        order = np.argsort(tiles, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(tiles[order])) + 1) if order.size else []
        self.source.prepare()

        def read(number: int) -> Positions:
            chosen = groups[number]
            rows, columns = (
                slice(int(line[chosen].min()), int(line[chosen].max()) + 1) for line in cells
            )
            window = widened((rows, columns), REACH, self.size)
            (values,) = self.source.read(window, [layer])
            corner = window[0].start, window[1].start
            return Surface(self.geometry, (0, 0), values, corner).at(flat[chosen], method)

        values = np.empty(len(flat))
        # For one tile, the scheduler takes longer than reading.
        found = in_any_order(read, range(len(groups))) if len(groups) > 1 else None
        for number, part in found or ((n, read(n)) for n in range(len(groups))):
            values[groups[number]] = part
        return float(values[0]) if points.ndim == 1 else values.reshape(points.shape[:-1])

    def to_xarray(self, layers: Iterable[str] | None = None) -> xarray.Dataset:
        """Return a dataset of Dask arrays, whose tiles are computed when they are used.

        A chunk is a tile, and is computed once, however many of its layers are used together. In
        all else the dataset is like that of `GridMap.to_xarray`, with `crs` as a CF grid mapping.
        Quantities of the whole map that a filter needs are computed at once.

        Args:
            layers: names of the layers; None means all.
        """
        dataset = to_lazy_dataset(self, layers)
        register()
        return dataset

    def thinned(self, step: int, layers: Iterable[str] | None = None) -> GridMap:
        """Return every `step`-th row and column as a map in memory, for pictures.

        Cells of the result are `step` times as large; the center of each is that of the cell whose
        value it has. Rasters are read from their overviews if they have any. If very many tiles
        would have to be read, `step` becomes larger than given.

        Args:
            step: rows and columns of the map per row and column of the result.
            layers: names of the layers to read; None means all.
        """
        from ._thinned import thinned_map

        return thinned_map(self, step, select_layers(self.layers, layers))

    def plot(self, layer: str = "", ax: Any = None, *, style: str = "flat", **options: Any) -> Any:
        """Draw as many cells as a picture can show, and return the axes; see `GridMap.plot`."""
        from ..map._plots import plot

        return plot(self, layer, ax, style, options)

    def over_tiles(
        self, function: Callable[[GridMap], T], layers: Iterable[str] | None = None
    ) -> list[T]:
        """Apply `function` to the map of every tile; return the results in tile order.

        The Dask scheduler of the program computes the tiles.

        Args:
            function: takes a `GridMap` with the layers; pickled if other processes compute.
            layers: names of the layers that the function needs; None means all.
        """
        names = select_layers(self.layers, layers)
        self.source.prepare()
        tiles = self.tiles

        def of_tile(number: int) -> T:
            return function(self.get_block(*tiles[number], names))

        results = dict(in_any_order(of_tile, range(len(tiles))))
        return [results[number] for number in range(len(tiles))]

    def filter(self, chain: Chain, **options: Any) -> TiledMap:
        """Return the filtered map; nothing is computed yet.

        Args:
            chain: a `FilterChain`.
            options: see `FilterChain.on_tiles`.

        Raises:
            FilterError: a filter needs the whole map in memory, or fails on every map.
        """
        source = chain.on_tiles(self, **options)
        return replace(self, source=source, basic_layers=source.basic_layers)

    def to_zarr(
        self,
        path: str | PathLike[str],
        *,
        layers: Iterable[str] | None = None,
        resume: bool = False,
        overwrite: bool = False,
        progress: Progress | None = None,
    ) -> None:
        """Compute the map and write it into a Zarr store, tile by tile.

        The store appears under its name when it is complete. Until then its tiles are in a folder
        beside it, whose name ends in `.part`.

        Args:
            path: the folder of the store.
            layers: names of the layers to write; None means all.
            resume: continue a run that did not finish: only missing tiles are computed, and the
                bytes equal those of an uninterrupted run.
            overwrite: replace an existing store.
            progress: called after each tile.

        Raises:
            GridMapError: a tile cannot be read, computed or written; the store exists; another
                process is writing it; or the unfinished run had other inputs.
        """
        names = select_layers(self.layers, layers)
        to_zarr(self, path, names, progress, resume=resume, overwrite=overwrite)

    def write(
        self,
        grid_map: GridMap,
        position: ArrayLike | None = None,
        *,
        layers: Iterable[str] | None = None,
    ) -> None:
        """Merge a map into the store that this map was opened from.

        Finite cells of the map replace those of the store. Each cell of the store gets the value of
        the map cell that contains its center, as with `GridMap.add_data_from`; cells of the map
        outside the store are ignored. Only chunks under the map are read and written, each of them
        atomically. Several processes may write at the same time without losing data.

        Args:
            grid_map: a map of the same resolution, and in the same frame or without one.
            position: (2,) center of the map [m]; None takes its own position.
            layers: names of the layers to write; None means all of the map.

        Raises:
            OutOfMapError: no cell of the map is on the store.
            GeometryError: the map has another resolution.
            GridMapError: this map was not opened from a Zarr store on this machine, the store lacks
                a layer, the frames differ, or the store cannot be written.
        """
        merge(self, grid_map, position, layers)

    def to_geotiff(
        self,
        path: str | PathLike[str],
        *,
        cog: bool = True,
        layers: Iterable[str] | None = None,
        compress: bool = True,
        overwrite: bool = False,
        progress: Progress | None = None,
    ) -> None:
        """Compute the map and write it into a GeoTIFF file, window by window.

        The file appears under its name when it is complete. Each layer is a band of float32 with
        its name; NaN is no data. A tag holds frame, time and basic layers, so that `open_map` and
        `load_geotiff` return the same map. While a cloud-optimized file is written, it also needs
        disk space for the uncompressed layers.

        Args:
            path: the file.
            cog: write a cloud-optimized GeoTIFF (COG), with overviews. A cell of an overview is the
                mean of the finite ones of its four cells, which is meaningless for packed colors.
            layers: names of the layers to write; None means all.
            compress: pack the values with deflate.
            overwrite: replace an existing file.
            progress: called after each window.
        """
        from ._rasters import to_geotiff

        names, options = select_layers(self.layers, layers), {"cog": cog, "compress": compress}
        to_geotiff(self, path, names, progress, overwrite=overwrite, **options)

    def position_of(self, latitude: ArrayLike, longitude: ArrayLike) -> Positions:
        """Convert latitudes and longitudes to positions in the frame of the map.

        Args:
            latitude, longitude: numbers, or (N,) each [deg, WGS 84].

        Returns:
            (2,) or (N, 2) x, y [m]; NaN outside the area of the reference system.

        Raises:
            GridMapError: the map has no reference system.
        """
        angles = (
            as_array(longitude, np.float64, "longitude"),
            as_array(latitude, np.float64, "latitude"),
        )
        if angles[0].shape != angles[1].shape or angles[0].ndim > 1:
            found = f"{short(latitude)} and {short(longitude)}"
            raise GeometryError(
                f"latitude, longitude: expected two numbers or two (N,), got {found}"
            )
        return _pairs(*_transformer(self.crs).transform(*angles)) - self.origin

    def latitude_longitude_of(self, positions: ArrayLike) -> Positions:
        """Convert positions to latitudes and longitudes; the inverse of `position_of`.

        Args:
            positions: (2,) or (N, 2) x, y [m], in the frame of the map.

        Returns:
            (2,) or (N, 2) latitude and longitude [deg, WGS 84].
        """
        x, y = np.moveaxis(as_positions(positions) + self.origin, -1, 0)
        longitude, latitude = _transformer(self.crs).transform(x, y, direction="INVERSE")
        return _pairs(latitude, longitude)

    def with_origin(self, latitude: float, longitude: float) -> TiledMap:
        """Return the map in a frame with its origin at a latitude and longitude.

        Coordinates in a reference system are millions of meters; those in a frame near the robot
        are small. The axes keep their directions. Datasets, stores and GeoTIFF files have the
        coordinates of the reference system, and hold the origin, from which `open_map` and
        `load_geotiff` restore the frame.

        Args:
            latitude, longitude: the new origin [deg, WGS 84].

        Raises:
            GridMapError: the map has no reference system, or it does not cover the origin.
        """
        origin = self.position_of(latitude, longitude)
        if not np.isfinite(origin).all():
            expected = "a place with coordinates in the reference system"
            raise ConfigError(f"origin: expected {expected}, got {latitude}, {longitude}")
        return self._in_frame_at(origin.tolist())


def _pairs(*coordinates: ArrayLike) -> Positions:
    """Return pairs (2,) or (N, 2); those outside the reference system are NaN."""
    pairs = np.stack([np.asarray(one, np.float64) for one in coordinates], axis=-1)
    pairs[~np.isfinite(pairs).all(axis=-1)] = np.nan
    return pairs


@lru_cache(maxsize=16)
def _transformer(crs: str) -> Any:
    """Return the PROJ transformer from longitude and latitude into a reference system."""
    if not crs:
        raise GridMapError(
            "the map has no reference system, so its place on the earth is not known; a GeoTIFF "
            "file or a store says it, or 'dataclasses.replace(tiled_map, crs=...)'"
        )
    remedy = "pip install 'grid_map_core_py[geo]'"
    proj = required("pyproj", "latitude and longitude", remedy)
    return proj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)


# --- datasets -------------------------------------------------------------------------------------


class GridMapAccessor:
    """Methods of grid maps for xarray, as `dataset.grid_map` and `array.grid_map`.

    Datasets in memory are computed at once, those of Dask lazily and tile by tile, like a
    `TiledMap`. `GridMap.from_xarray` says which datasets are maps.
    """

    def __init__(self, data: xarray.Dataset | xarray.DataArray) -> None:
        """Wrap a dataset or an array, which is checked on the first call."""
        self._data = data

    @cached_property
    def _dataset(self) -> xarray.Dataset:
        return as_dataset(self._data)

    @cached_property
    def _is_lazy(self) -> bool:
        return any(self._dataset[name].chunks for name in layers_of(self._dataset))

    @cached_property
    def _opened(self) -> TiledMap:
        opened = TiledMap(**vars(open_dataset(self._dataset)))
        if not self._is_lazy:
            return replace(opened, tile=opened.size)
        origin = origin_of(self._dataset, opened.layers)
        return replace(opened, source=origin.source) if origin else opened

    def to_map(self, layers: Iterable[str] | None = None) -> GridMap:
        """Return the map in memory; see `GridMap.from_xarray`."""
        return self._opened.to_map(layers)

    def filter(self, chain: Chain, **options: Any) -> xarray.Dataset:
        """Return the filtered dataset, with the dimensions and coordinates of this one.

        Args:
            chain: a `FilterChain`.
            options: for datasets of Dask, those of `FilterChain.on_tiles`.

        Raises:
            FilterError: a filter fails, or needs the whole map of a Dask dataset in memory.
        """
        mine, opened = self._dataset, self._opened
        if self._is_lazy:
            tiled_map = opened.filter(chain, **options)
            filtered = tiled_map.to_xarray()
        else:
            filtered = to_dataset(chain(self.to_map()), opened.crs)
            if any(opened.origin):
                filtered.attrs["origin"] = [*opened.origin]
        filtered = filtered.isel(turned(geometry_of(mine)[1]))
        if opened.layers:
            filtered = filtered.transpose(*mine[opened.layers[0]].dims)
        # Coordinates with other rounding errors would not be aligned.
        filtered = filtered.assign_coords({name: mine[name].variable for name in DIMENSIONS})
        if self._is_lazy:
            remember(filtered, tiled_map)
        return filtered

    def get_submap(self, position: ArrayLike, length: ArrayLike) -> xarray.Dataset:
        """Return the cells that a rectangle overlaps without a copy; see `TiledMap.get_submap`."""
        geometry, ascends = geometry_of(self._dataset)
        window = geometry.overlapped(position, length)
        stored = zip(DIMENSIONS, mirrored(window, geometry.size, ascends), strict=True)
        part = self._dataset.isel(dict(stored))
        return part.assign_attrs(position=geometry.cropped(*window).position.tolist())

    def at_position(
        self,
        layer: str,
        positions: ArrayLike,
        interpolation: Interpolation | str = Interpolation.NEAREST,
    ) -> float | Positions:
        """Return the values of a layer at positions; see `TiledMap.at_position`."""
        return self._opened.at_position(layer, positions, interpolation)

    def plot(self, layer: str = "", ax: Any = None, *, style: str = "flat", **options: Any) -> Any:
        """Draw the map with Matplotlib, and return the axes; see `GridMap.plot`."""
        return self._opened.plot(layer, ax, style=style, **options)


@cache
def register() -> None:
    """Add the accessor to xarray."""
    xr = required("xarray", "the accessor `grid_map`", REMEDY)
    xr.register_dataset_accessor("grid_map")(GridMapAccessor)
    xr.register_dataarray_accessor("grid_map")(GridMapAccessor)
