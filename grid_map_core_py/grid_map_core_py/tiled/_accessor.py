# SPDX-License-Identifier: BSD-3-Clause
"""The accessor `grid_map` of datasets and arrays of xarray."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, Protocol

from numpy.typing import ArrayLike

from .._arrays._checks import Positions
from ..errors import required
from ..map._grid_map import GridMap
from ..map._interpolation import Interpolation
from ._datasets import DIMENSIONS, REMEDY, as_dataset, layers_of
from ._lazy import origin_of, remember
from ._tiled_map import Chain, TiledMap
from ._xarray import DatasetSource, from_dataset, open_dataset, to_dataset

if TYPE_CHECKING:
    import xarray


class MapChain(Chain, Protocol):
    """A chain that `filter` of the accessor takes, such as `FilterChain`."""

    def __call__(self, grid_map: GridMap) -> GridMap:
        """Return the filtered map."""


@cache
def register() -> None:
    """Add the accessor to xarray."""
    xr = required("xarray", "the accessor `grid_map`", REMEDY)
    xr.register_dataset_accessor("grid_map")(GridMapAccessor)
    xr.register_dataarray_accessor("grid_map")(GridMapAccessor)


class GridMapAccessor:
    """The abilities of a grid map, as `dataset.grid_map` and `array.grid_map`.

    Datasets in memory are computed at once, those of Dask later, tile by tile, as a `TiledMap`.
    `GridMap.from_xarray` says which datasets are maps.
    """

    def __init__(self, data: xarray.Dataset | xarray.DataArray) -> None:
        """Take a dataset or an array; it is examined with the first call."""
        self._data = data

    @cached_property
    def _dataset(self) -> xarray.Dataset:
        return as_dataset(self._data)

    @cached_property
    def _opened(self) -> TiledMap:
        site = open_dataset(self._dataset)
        return site if self._is_lazy else replace(site, tile=site.size)

    @property
    def _site(self) -> TiledMap:
        origin = origin_of(self._dataset, self._opened.layers)
        return replace(self._opened, source=origin.source) if origin else self._opened

    @property
    def _source(self) -> DatasetSource:
        source: Any = self._opened.source
        return source  # type: ignore[no-any-return]

    def to_map(self, layers: Iterable[str] | None = None) -> GridMap:
        """Return the map in memory; see `GridMap.from_xarray`."""
        return from_dataset(self._dataset, layers)

    def filter(self, chain: MapChain, **options: Any) -> xarray.Dataset:
        """Return the filtered dataset, with the dimensions and coordinates of this one.

        Args:
            chain: a `FilterChain`.
            options: those of `FilterChain.on_tiles`, for datasets of Dask.

        Raises:
            FilterError: a filter fails, or needs the whole map, which Dask does not have in memory.
        """
        if not self._is_lazy:
            return self._arranged(to_dataset(chain(self.to_map()), self._opened.crs))
        site = self._site.filter(chain, **options)
        filtered = self._arranged(site.to_xarray())
        remember(filtered, site)
        return filtered

    def submap(self, position: ArrayLike, length: ArrayLike) -> xarray.Dataset:
        """Return the cells that a rectangle overlaps, those of `GridMap.get_submap`; no copy.

        Args:
            position: (2,) center of the rectangle [m].
            length: (2,) its sides [m].

        Raises:
            OutOfMapError: the rectangle does not overlap the map.
        """
        geometry = self._opened.geometry
        window = geometry.overlapped(position, length)
        part = self._dataset.isel(self._source.stored(window))
        return part.assign_attrs(position=geometry.cropped(*window).position.tolist())

    def at(
        self,
        positions: ArrayLike,
        layer: str,
        interpolation: Interpolation | str = Interpolation.NEAREST,
    ) -> float | Positions:
        """Return the values of a layer at positions; see `TiledMap.at`."""
        return self._site.at(positions, layer, interpolation)

    def plot(self, layer: str = "", ax: Any = None, *, style: str = "flat", **options: Any) -> Any:
        """Draw the map by Matplotlib, and return the axes; see `GridMap.plot`."""
        from ..map._plots import plot

        return plot(self._site, layer, ax, style, options)

    @property
    def _is_lazy(self) -> bool:
        return any(self._dataset[name].chunks for name in layers_of(self._dataset))

    def _arranged(self, filtered: xarray.Dataset) -> xarray.Dataset:
        """Return a dataset in the order and with the coordinates of this one.

        Coordinates that differ by a rounding error would not be aligned.
        """
        source, mine = self._source, self._dataset
        ascending = [
            name for name, ascends in zip(DIMENSIONS, source.ascends, strict=True) if ascends
        ]
        turned = filtered.isel({name: slice(None, None, -1) for name in ascending})
        if source.layers:
            turned = turned.transpose(*mine[source.layers[0]].dims)
        return turned.assign_coords({name: mine[name].variable for name in DIMENSIONS})
