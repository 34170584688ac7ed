# SPDX-License-Identifier: BSD-3-Clause
"""A map of any size, of which only windows are in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from numpy.typing import ArrayLike

from .._arrays._checks import Layer, Positions, Size, as_names, select_layers
from ..limits import check_cells
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..map._interpolation import Interpolation
from ._engine import in_any_order
from ._source import Source, Tiles

if TYPE_CHECKING:
    import xarray

T = TypeVar("T")

Progress = Callable[[int, int], Any]
"""Function that is called after each tile, with the number of finished tiles and of all."""


class Chain(Protocol):
    """Chain for `TiledMap.filter`, such as `FilterChain` of grid_map_filters_py."""

    @property
    def on_tiles(self) -> Callable[..., FilteredSource]:
        """Function of a `TiledMap` and options.

        It returns the filtered layers, which are computed when they are read.
        """


class FilteredSource(Source, Protocol):
    """Layers after a chain."""

    @property
    def basic_layers(self) -> tuple[str, ...]:
        """Names of the basic layers."""


@dataclass(frozen=True, eq=False)
class TiledMap:
    """A map whose layers are read, or computed, window by window.

    Make one by `open_map`. It is immutable, but for `write`; like its source it can be pickled.

    Args:
        source: where the layers come from.
        geometry: size, resolution and position, in the frame.
        tile: rows and columns of a tile.
        frame_id: frame of the map.
        timestamp: time [ns].
        basic_layers: see `GridMap.basic_layers`.
        crs: coordinate reference system of the frame, as text; empty if unknown.
    """

    source: Source
    geometry: GridGeometry
    tile: Size
    frame_id: str = "map"
    timestamp: int = 0
    basic_layers: tuple[str, ...] = ()
    crs: str = ""

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
        """Make a Zarr store without data for `write`, and return its map.

        Whatever its size, the store takes a few kilobytes. A chunk takes room when data is written
        into it; cells of other chunks are NaN.

        Args:
            path: the folder of the store, which must not exist.
            geometry: size, resolution and position.
            layers: names of the layers.
            chunks: side of a chunk [cells].
            basic_layers, frame_id, timestamp: see `GridMap`.
            crs: see `TiledMap`.

        Raises:
            GridMapError: there is something at the path, a name is not allowed, or the store cannot
                be written.
        """
        from ._store import create_store

        return create_store(
            path,
            geometry,
            as_names(layers),
            chunks=chunks,
            basic_layers=as_names(basic_layers),
            frame_id=frame_id,
            timestamp=timestamp,
            crs=crs,
        )

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers in their order."""
        return self.source.layers

    @property
    def size(self) -> Size:
        """Rows and columns."""
        return self.geometry.size

    @property
    def resolution(self) -> float:
        """Side of a cell [m]."""
        return self.geometry.resolution

    @property
    def position(self) -> Positions:
        """Center of the map, (2,) [m]."""
        return self.geometry.position

    @property
    def length(self) -> Positions:
        """Sides of the map along x and y, (2,) [m]."""
        return self.geometry.length

    @property
    def tiles(self) -> Tiles:
        """The tiles, as windows of cells."""
        return Tiles(self.size, self.tile)

    def block(self, rows: slice, columns: slice, layers: Iterable[str] | None = None) -> GridMap:
        """Return the map of a rectangle of cells.

        Args:
            rows, columns: slices of the map in map order: with a start and a stop on the map.
            layers: names of the layers to read; None means all.

        Raises:
            LayerNotFoundError: a layer does not exist.
            LimitError: the block has more cells than the limits allow.
            GridMapError: the layers cannot be read or computed.
        """
        names = select_layers(self.layers, layers)
        window = rows, columns
        is_whole = window == (slice(0, self.size[0]), slice(0, self.size[1]))
        # That of a part has rounding errors.
        geometry = self.geometry if is_whole else self.geometry.cropped(*window)
        check_cells("submap", geometry.size, len(names))
        self.source.prepare()
        return self._map(geometry, names, self.source.read(window, names))

    def _map(self, geometry: GridGeometry, names: Sequence[str], layers: list[Layer]) -> GridMap:
        """Return a map of some layers."""
        empty = GridMap.from_geometry(geometry, frame_id=self.frame_id, timestamp=self.timestamp)
        # Adopts the layers, which belong to nobody else.
        grid_map = empty.with_layers(dict(zip(names, layers, strict=True)))
        grid_map.basic_layers = [name for name in self.basic_layers if name in names]
        return grid_map

    def submap(
        self, position: ArrayLike, length: ArrayLike, layers: Iterable[str] | None = None
    ) -> GridMap:
        """Return the map of a rectangle; only the chunks that it touches are read.

        The cells are those of `GridMap.get_submap`.

        Args:
            position: (2,) center of the rectangle [m].
            length: (2,) its sides [m].
            layers: names of the layers to read; None means all.

        Raises:
            OutOfMapError: no cell of the map is in the rectangle.
            LayerNotFoundError: a layer does not exist.
            LimitError: the rectangle has more cells than the limits allow.
        """
        return self.block(*self.geometry.overlapped(position, length), layers)

    def to_map(self, layers: Iterable[str] | None = None) -> GridMap:
        """Return the whole map, if the limits allow its size; see `block`."""
        rows, columns = self.size
        return self.block(slice(0, rows), slice(0, columns), layers)

    def at(
        self,
        positions: ArrayLike,
        layer: str,
        interpolation: Interpolation | str = Interpolation.NEAREST,
    ) -> float | Positions:
        """Return the values of a layer at positions; only cells around them are read.

        The values are those of `GridMap.at_position`, also beside the borders of tiles. Tiles are
        read by the scheduler of Dask that the program has chosen.

        Args:
            positions: (2,) or (N, 2) x, y [m].
            layer: name of the layer.
            interpolation: the method, or its value as a string such as "linear".

        Returns:
            A float for one position, else (N,) float64.

        Raises:
            LayerNotFoundError: there is no such layer.
            OutOfMapError: a position is NaN or not on the map.
            GridMapError: the layer cannot be read or computed.
        """
        from ._at import at

        return at(self, positions, layer, interpolation)

    def to_xarray(self, layers: Iterable[str] | None = None) -> xarray.Dataset:
        """Return a dataset of Dask arrays, whose tiles are computed when they are used.

        A chunk is a tile. A tile is computed once, however many of its layers are used together.
        The rest is as with `GridMap.to_xarray`; `crs` is a variable as CF has it. Quantities of the
        whole map that a filter needs are computed at once.

        Args:
            layers: names of the layers; None means all.

        Raises:
            LayerNotFoundError: a layer does not exist.
            MissingPackageError: xarray or Dask is not installed.
        """
        from ._lazy import to_lazy_dataset

        return to_lazy_dataset(self, layers)

    def thinned(self, step: int, layers: Iterable[str] | None = None) -> GridMap:
        """Return the map of every `step`-th row and column, for pictures.

        The cells are `step` times as large; the center of each is that of the cell of this map
        whose value it has. A raster is read from its overviews, where cells are those of the
        overview. Tiles are read one by one. Of a map of very many tiles, some are left out, and
        `step` is larger than given.

        Args:
            step: number of rows, and of columns, for one of the result.
            layers: names of the layers to read; None means all.

        Raises:
            LayerNotFoundError: a layer does not exist.
            LimitError: the result has more cells than the limits allow.
            GridMapError: the layers cannot be read or computed.
        """
        from ._thinned import thinned_map

        return thinned_map(self, step, select_layers(self.layers, layers))

    def plot(self, layer: str = "", ax: Any = None, *, style: str = "flat", **options: Any) -> Any:
        """Draw as much as a picture can show, and return the axes; see `GridMap.plot`."""
        from ..map._plots import plot

        return plot(self, layer, ax, style, options)

    def over_tiles(
        self, function: Callable[[GridMap], T], layers: Iterable[str] | None = None
    ) -> list[T]:
        """Return `function` of the map of every tile, in the order of the tiles.

        The tiles are computed by the scheduler of Dask that the program has chosen.

        Args:
            function: takes a `GridMap` with the layers; is pickled if other processes compute.
            layers: names of the layers that it needs; None means all.
        """
        names = select_layers(self.layers, layers)
        self.source.prepare()
        tiles = self.tiles
        results: dict[int, T] = dict(
            in_any_order(partial(_of_tile, self, function, names), range(len(tiles)))
        )
        return [results[number] for number in range(len(tiles))]

    def filter(self, chain: Chain, **options: Any) -> TiledMap:
        """Return the filtered map; nothing is computed yet.

        Args:
            chain: a `FilterChain`.
            options: see `FilterChain.on_tiles`.

        Raises:
            FilterError: a filter needs the whole map in memory, or fails on all maps.
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

        The store has its name when it is complete. Until then its tiles are in a folder beside it,
        whose name has `.part` at the end.

        Args:
            path: the folder of the store.
            layers: names of the layers to write; None means all.
            resume: continue a run that did not finish: only missing tiles are computed, and the
                bytes are those of a run that was not disturbed.
            overwrite: replace a store that exists.
            progress: is called after each tile.

        Raises:
            LayerNotFoundError: a layer does not exist.
            GridMapError: a tile cannot be read, computed or written; the store exists; another
                process is writing it; or the unfinished run was another one.
        """
        from ._store import to_zarr

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

        Finite cells of the map replace those of the store; the others leave the store as it is.
        Every cell of the store takes the cell of the map that its center is in, as with
        `GridMap.add_data_from`; cells of the map outside the store are ignored. Only chunks under
        the map are read and written. A reader finds every chunk as it was before or after; several
        processes can write at once, and none of their data is lost.

        Args:
            grid_map: a map of the same resolution, and in the same frame or without one.
            position: (2,) where its center is [m]; None takes its own position.
            layers: names of the layers to write; None means all of the map.

        Raises:
            OutOfMapError: no cell of the map is on the store.
            LayerNotFoundError: the map lacks a layer that `layers` names.
            GeometryError: the map has another resolution.
            GridMapError: this map is not that of a Zarr store on this machine, the store lacks a
                layer, the frames differ, or the store cannot be written.
        """
        from ._write import write

        write(self, grid_map, position, layers)

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

        The file has its name when it is complete. A layer is a band of float32, named after it; NaN
        is no data; a tag holds frame, time and basic layers, so that `open_map` and `load_geotiff`
        return the same map. While it is written, a cloud-optimized file takes the space of the
        uncompressed layers, besides.

        Args:
            path: the file.
            cog: write a cloud-optimized GeoTIFF (COG), with overviews. A cell of an overview is the
                mean of the finite ones of its four cells, which means nothing for packed colors.
            layers: names of the layers to write; None means all.
            compress: pack the values by deflate.
            overwrite: replace a file that exists.
            progress: is called after each window.

        Raises:
            LayerNotFoundError: a layer does not exist.
            GridMapError: a window cannot be read, computed or written; the file exists; or rasterio
                is not installed.
        """
        from ._raster_files import to_geotiff

        names, options = select_layers(self.layers, layers), {"cog": cog, "compress": compress}
        to_geotiff(self, path, names, progress, overwrite=overwrite, **options)

    def position_of(self, latitude: ArrayLike, longitude: ArrayLike) -> Positions:
        """Return places on the earth in the frame of the map.

        Args:
            latitude, longitude: numbers, or (N,) each [deg, WGS 84].

        Returns:
            (2,) or (N, 2) x, y [m]; NaN where the reference system does not reach.

        Raises:
            GridMapError: the map has no reference system, or pyproj is not installed.
        """
        from ._earth import position_of

        return position_of(self.crs, latitude, longitude)

    def latitude_longitude_of(self, positions: ArrayLike) -> Positions:
        """Return where positions are on the earth, the inverse of `position_of`.

        Args:
            positions: (2,) or (N, 2) x, y [m], in the frame of the map.

        Returns:
            (2,) or (N, 2) latitude and longitude [deg, WGS 84].

        Raises:
            GridMapError: the map has no reference system, or pyproj is not installed.
        """
        from ._earth import latitude_longitude_of

        return latitude_longitude_of(self.crs, positions)

    def with_origin(self, latitude: float, longitude: float) -> TiledMap:
        """Return the map in a frame whose origin is a place on the earth.

        Coordinates of the earth are millions of meters; those of a frame near the robot are small.
        The axes keep their directions. The reference system of the result is that of the map with
        another false easting and northing, so that its coordinates are those of the frame. Stores
        keep it. GeoTIFF files have the coordinates of the reference system before, and a tag with
        the origin, from which `open_map` and `load_geotiff` get the frame again.

        Args:
            latitude, longitude: the place [deg, WGS 84].

        Raises:
            GridMapError: the map has no reference system, or one that cannot be moved; the place
                has no coordinates in it; or pyproj is not installed.
        """
        from ._earth import moved_map

        return moved_map(self, self.position_of(latitude, longitude))


def _of_tile(
    site: TiledMap, function: Callable[[GridMap], T], names: Sequence[str], number: int
) -> T:
    return function(site.block(*site.tiles[number], names))
