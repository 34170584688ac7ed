# SPDX-License-Identifier: BSD-3-Clause
"""Maps of any size, and the xarray accessor `grid_map`."""

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
    """Interface of filter chains, which `FilterChain` in grid_map_filters_py implements."""

    @property
    def on_tiles(self) -> Callable[..., Any]:
        """Function that filters a `TiledMap`, and returns a source with `basic_layers`."""

    def __call__(self, grid_map: GridMap) -> GridMap:
        """Return the filtered map."""


@dataclass(frozen=True, eq=False)
class TiledMap(TiledData):
    """Map of any size whose layers are read or computed window by window.

    `open_map` returns a `TiledMap`. Tiled maps can be pickled. Only the method `write` changes the
    data.

    Args:
        source: provider of the layers.
        geometry: size, resolution and position in the map frame.
        tile: rows and columns of a tile.
        frame_id: name of the map frame.
        timestamp: time of the map [ns].
        basic_layers: see `GridMap.basic_layers`.
        crs: coordinate reference system as text, such as WKT; empty if unknown.
        origin: coordinates of the frame origin in the reference system [m].
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
        """Create an empty Zarr store, to be filled with `write`, and return it as a map.

        The empty store uses a few kilobytes, regardless of the map size. A chunk uses disk space
        only once it is written. Until then, its cells are NaN.

        Args:
            path: folder of the store, which must not exist.
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
        """Read a rectangle of cells as a map in memory.

        Args:
            rows, columns: slices in map order, with start and stop within the map.
            layers: names of the layers to read; None means all.

        Raises:
            LayerNotFoundError: a layer does not exist.
            LimitError: the block has more cells than the limits allow.
            GridMapError: the layers cannot be read or computed.
        """
        names = select_layers(self.layers, layers)
        window = rows, columns
        is_whole = window == (slice(0, self.size[0]), slice(0, self.size[1]))
        # A cropped geometry would have rounding errors.
        geometry = self.geometry if is_whole else self.geometry.cropped(*window)
        check_cells("map", geometry.size, len(names))
        self.source.prepare()
        return self._map(geometry, names, self.source.read(window, names))

    def _map(self, geometry: GridGeometry, names: Sequence[str], layers: list[Layer]) -> GridMap:
        empty = GridMap.from_geometry(geometry, frame_id=self.frame_id, timestamp=self.timestamp)
        empty._reference = self.crs, self.origin
        grid_map = empty.with_layers(dict(zip(names, layers, strict=True)))
        grid_map.basic_layers = [name for name in self.basic_layers if name in names]
        return grid_map

    def get_submap(
        self, position: ArrayLike, length: ArrayLike, layers: Iterable[str] | None = None
    ) -> GridMap:
        """Return the cells that a rectangle overlaps, as a map in memory.

        Only chunks under the rectangle are read. `GridMap.get_submap` returns the same cells.

        Args:
            position: (2,) center of the rectangle [m].
            length: (2,) side lengths of the rectangle [m].
            layers: names of the layers to read; None means all.

        Raises:
            OutOfMapError: the rectangle does not overlap the map.
        """
        return self.get_block(*self.geometry.overlapped(position, length), layers)

    def to_map(self, layers: Iterable[str] | None = None) -> GridMap:
        """Read the whole map into memory; raise `LimitError` if the map exceeds the limits."""
        rows, columns = self.size
        return self.get_block(slice(0, rows), slice(0, columns), layers)

    def at_position(
        self,
        layer: str,
        positions: ArrayLike,
        interpolation: Interpolation | str = Interpolation.NEAREST,
    ) -> float | Positions:
        """Return the values of a layer at positions; only nearby cells are read.

        The results equal those of `GridMap.at_position`, even at tile borders. If the positions lie
        in several tiles, the program's Dask scheduler reads these tiles.

        Args:
            layer: name of the layer.
            positions: (2,) or (N, 2) x, y [m].
            interpolation: interpolation method, or its name such as "linear".

        Returns:
            A float for one position, otherwise an (N,) float64 array.

        Raises:
            OutOfMapError: a position is NaN or outside the map.
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
        # For a single tile, scheduling takes longer than reading.
        found = in_any_order(read, range(len(groups))) if len(groups) > 1 else None
        for number, part in found or ((n, read(n)) for n in range(len(groups))):
            values[groups[number]] = part
        return float(values[0]) if points.ndim == 1 else values.reshape(points.shape[:-1])

    def to_xarray(self, layers: Iterable[str] | None = None) -> xarray.Dataset:
        """Convert the map to a dataset of Dask arrays, which are computed on demand.

        Each tile becomes one chunk. A chunk is computed only once, even if several layers are used
        together. If a filter needs quantities of the whole map, `to_xarray` computes these
        quantities immediately. In all other respects, the dataset equals the result of
        `GridMap.to_xarray`.

        Args:
            layers: names of the layers; None means all.
        """
        dataset = to_lazy_dataset(self, layers)
        register()
        return dataset

    def thinned(self, step: int, layers: Iterable[str] | None = None) -> GridMap:
        """Return every `step`-th row and column as a map in memory, for example for display.

        Cells of the result are `step` times as wide as cells of this map. Each cell of the result
        has the value at its center. If the map is a raster with a suitable overview, the values
        come from the overview, and the step is rounded up to a multiple of the step of the
        overview. If more than about 4000 tiles would be read, a larger step is used.

        Args:
            step: distance between copied rows and between copied columns [cells].
            layers: names of the layers to read; None means all.
        """
        from ._thinned import thinned_map

        return thinned_map(self, step, select_layers(self.layers, layers))

    def plot(self, layer: str = "", ax: Any = None, *, style: str = "flat", **options: Any) -> Any:
        """Plot the map, thinned to the resolution of the plot; see `GridMap.plot`."""
        from ..map._plots import plot

        return plot(self, layer, ax, style, options)

    def over_tiles(
        self, function: Callable[[GridMap], T], layers: Iterable[str] | None = None
    ) -> list[T]:
        """Apply `function` to the map of every tile and return the results in tile order.

        The program's Dask scheduler computes the tiles.

        Args:
            function: called with each tile as a `GridMap`; pickled if other processes call it.
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
        """Return the filtered map, whose tiles are computed on demand.

        Before that, the chain is run once on a small test map of zeros.

        Args:
            chain: a `FilterChain`.
            options: see `FilterChain.on_tiles`.

        Raises:
            FilterError: a filter needs the whole map in memory, or the chain fails on the test map.
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
        """Compute the map and write the tiles to a Zarr store.

        An unfinished store is a folder named `path` with the suffix `.part`. The folder is renamed
        to `path` once the store is complete.

        Args:
            path: folder of the store.
            layers: names of the layers to write; None means all.
            resume: continue an unfinished run, and compute only the missing tiles. The store is
                identical to the store of an uninterrupted run.
            overwrite: replace an existing store.
            progress: called after each tile with the number of finished tiles and the total.

        Raises:
            GridMapError: the store exists, another process is writing it, or a tile cannot be read,
                computed or written. The error is also raised for an unfinished run if `resume` is
                False or the inputs differ.
        """
        names = select_layers(self.layers, layers)
        to_zarr(self, path, names, progress or _silent, resume=resume, overwrite=overwrite)

    def write(
        self,
        grid_map: GridMap,
        position: ArrayLike | None = None,
        *,
        layers: Iterable[str] | None = None,
    ) -> None:
        """Merge a map into the store that this map was opened from.

        Each store cell gets the value of the map cell that contains its center, as with
        `GridMap.add_data_from`. Map cells that are not finite or outside the store are ignored.
        Only chunks under the map are read and written. Several processes may write at the same time
        without losing data. With Zarr 2, and with Zarr 3.1.3 or later, readers never see a partly
        written chunk.

        Args:
            grid_map: map with the same resolution, in the same frame or without a frame.
            position: (2,) center of the map [m]; None uses the position of `grid_map`.
            layers: names of the layers to write; None means all layers of `grid_map`.

        Raises:
            OutOfMapError: the map and the store do not overlap.
            GeometryError: the resolutions differ.
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
        """Compute the map and write it to a GeoTIFF file, window by window.

        The method writes a temporary file next to `path`, and renames the complete file to `path`.
        Each layer is a float32 band named after the layer. The nodata value is NaN. A tag stores
        frame, time and basic layers, so that `open_map` and `load_geotiff` restore the same map.

        Args:
            path: path of the file.
            cog: write a cloud-optimized GeoTIFF (COG) with overviews. Writing it temporarily needs
                disk space for the uncompressed layers. An overview cell is the mean of the finite
                values of four cells, which is meaningless for packed colors.
            layers: names of the layers to write; None means all.
            compress: compress the values with deflate.
            overwrite: replace an existing file.
            progress: called after each window with the number of finished windows and the total.
        """
        from ._rasters import to_geotiff

        names, options = select_layers(self.layers, layers), {"cog": cog, "compress": compress}
        to_geotiff(self, path, names, progress or _silent, overwrite=overwrite, **options)

    def position_of(self, latitude: ArrayLike, longitude: ArrayLike) -> Positions:
        """Convert latitudes and longitudes to positions in the map frame.

        Args:
            latitude, longitude: numbers or (N,) arrays [deg, WGS 84].

        Returns:
            (2,) or (N, 2) x, y [m]; NaN outside the valid area of the reference system.

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
            positions: (2,) or (N, 2) x, y [m], map frame.

        Returns:
            (2,) or (N, 2) latitude and longitude [deg, WGS 84].
        """
        x, y = np.moveaxis(as_positions(positions) + self.origin, -1, 0)
        longitude, latitude = _transformer(self.crs).transform(x, y, direction="INVERSE")
        return _pairs(latitude, longitude)

    def with_origin(self, latitude: float, longitude: float) -> TiledMap:
        """Return the map in a frame whose origin has a given latitude and longitude.

        Coordinates in a reference system can reach millions of meters. In a frame whose origin is
        near the robot, coordinates are small. The axes keep their directions. Datasets, stores and
        GeoTIFF files still contain coordinates in the reference system. They also store the origin,
        so that `open_map` and `load_geotiff` can restore the frame.

        Args:
            latitude, longitude: the new origin [deg, WGS 84].

        Raises:
            GridMapError: the map has no reference system, or the system is not valid at the origin.
        """
        origin = self.position_of(latitude, longitude)
        if not np.isfinite(origin).all():
            expected = "a place with coordinates in the reference system"
            raise ConfigError(f"origin: expected {expected}, got {latitude}, {longitude}")
        return self._in_frame_at(origin.tolist())


def _silent(done: int, total: int) -> None:
    """Show no progress."""


def _pairs(*coordinates: ArrayLike) -> Positions:
    """Combine coordinates into pairs (2,) or (N, 2); pairs that are not finite become NaN."""
    pairs = np.stack([np.asarray(one, np.float64) for one in coordinates], axis=-1)
    pairs[~np.isfinite(pairs).all(axis=-1)] = np.nan
    return pairs


@lru_cache(maxsize=16)
def _transformer(crs: str) -> Any:
    """Return the PROJ transformer from longitude and latitude to a reference system."""
    if not crs:
        raise GridMapError(
            "the map has no reference system, so its place on the earth is unknown; a GeoTIFF "
            "file or a store says it, or 'dataclasses.replace(tiled_map, crs=...)'"
        )
    proj = required("pyproj", "latitude and longitude")
    return proj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)


# --- datasets -------------------------------------------------------------------------------------


class GridMapAccessor:
    """xarray accessor with grid map methods: `dataset.grid_map` and `array.grid_map`.

    Datasets in memory are processed immediately. Datasets of Dask arrays are processed tile by tile
    on demand, like a `TiledMap`. `GridMap.from_xarray` describes which datasets are accepted.
    """

    def __init__(self, data: xarray.Dataset | xarray.DataArray) -> None:
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
        """Convert the dataset to a map in memory; see `GridMap.from_xarray`."""
        return self._opened.to_map(layers)

    def filter(self, chain: Chain, **options: Any) -> xarray.Dataset:
        """Return the filtered dataset, which has the same dimensions and coordinates.

        Args:
            chain: a `FilterChain`.
            options: for Dask datasets, the options of `FilterChain.on_tiles`.

        Raises:
            FilterError: a filter fails, or the data are Dask arrays and a filter needs the whole
                map in memory.
        """
        mine, opened = self._dataset, self._opened
        if self._is_lazy:
            tiled_map = opened.filter(chain, **options)
            filtered = tiled_map.to_xarray()
        else:
            filtered = to_dataset(chain(self.to_map()))
        filtered = filtered.isel(turned(geometry_of(mine)[1]))
        if opened.layers:
            filtered = filtered.transpose(*mine[opened.layers[0]].dims)
        # xarray could not align the coordinates if their rounding errors differed.
        filtered = filtered.assign_coords({name: mine[name].variable for name in DIMENSIONS})
        if self._is_lazy:
            remember(filtered, tiled_map)
        return filtered

    def get_submap(self, position: ArrayLike, length: ArrayLike) -> xarray.Dataset:
        """Return the part of the dataset that a rectangle overlaps; see `TiledMap.get_submap`."""
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
        """Plot the map with Matplotlib and return the axes; see `GridMap.plot`."""
        return self._opened.plot(layer, ax, style=style, **options)


@cache
def register() -> None:
    """Register the accessor `grid_map` in xarray."""
    xr = required("xarray", "the accessor `grid_map`")
    xr.register_dataset_accessor("grid_map")(GridMapAccessor)
    xr.register_dataarray_accessor("grid_map")(GridMapAccessor)
