# SPDX-License-Identifier: BSD-3-Clause
"""Tiled maps as datasets of Dask arrays, with one chunk per tile.

One task computes a tile with all its layers, and one per layer takes it out, so that a tile is
computed once, however many of its layers are used. Layers that are only read have tasks of their
own, so that the others are not read.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any
from uuid import uuid4
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer, Size, select_layers
from ..errors import required
from ._source import Window
from ._tiled_map import TiledMap
from ._xarray import attributes, dataset_of

if TYPE_CHECKING:
    import xarray

_REMEDY = "pip install 'grid_map_core_py[tiled]'"


_SITE = "site-"
"""Beginning of the keys of maps in graphs."""


def to_lazy_dataset(site: TiledMap, layers: Iterable[str] | None = None) -> "xarray.Dataset":
    """Return the dataset of a tiled map; see `TiledMap.to_xarray`."""
    required("dask.array", "a dataset that is computed later", _REMEDY)
    names = select_layers(site.layers, layers)
    site.source.prepare()
    make = _lone_layers if getattr(site.source, "reads_layers_alone", False) else _joint_layers
    basic = [name for name in site.basic_layers if name in names]
    about = attributes(site.geometry, names, site.frame_id, site.timestamp, basic)
    dataset = dataset_of(site.geometry, make(site, names), about, site.crs)
    remember(dataset, site)
    return dataset


_ORIGINS = WeakValueDictionary[tuple[str, str], TiledMap]()
"""Tiled maps by the names of layers and of their arrays of Dask."""


def remember(dataset: "xarray.Dataset", site: TiledMap) -> None:
    """Remember of which map the layers of a lazy dataset are, in any order of its cells."""
    for name in site.layers:
        if name in dataset:
            _ORIGINS[name, dataset[name].data.name] = site


def origin_of(dataset: "xarray.Dataset", layers: Sequence[str]) -> TiledMap | None:
    """Return the map whose layers these are, all of them and unchanged; None if there is none.

    Windows of the map cost less than windows of Dask arrays, which compute all tiles around.
    """
    arrays = {name: dataset[name].data for name in layers if dataset[name].chunks}
    found = {_ORIGINS.get((name, array.name)) for name, array in arrays.items()}
    (site,) = found if len(found) == 1 else (None,)
    if site is None or tuple(layers) != site.layers or len(arrays) != len(layers):
        return None
    # Layers that have been computed and kept need no map.
    is_waiting = all(any(key.startswith(_SITE) for key in a.dask.layers) for a in arrays.values())
    return site if is_waiting else None


def _lone_layers(site: TiledMap, names: Sequence[str]) -> dict[str, Any]:
    known = _known(site)
    return {name: _blocks(partial(_read, name), _chunks(site), site=known) for name in names}


def _joint_layers(site: TiledMap, names: Sequence[str]) -> dict[str, Any]:
    chunks = _chunks(site)
    ones = tuple((1,) * len(side) for side in chunks)
    tiles = _blocks(partial(_read_all, names), ones, object, site=_known(site))
    return {
        name: _blocks(partial(_one_of, number), chunks, of=tiles)
        for number, name in enumerate(names)
    }


def _known(site: TiledMap) -> Any:
    """Return the map as a key of the graph: a cluster sends it once to each worker."""
    from dask.delayed import delayed

    return delayed(site, name=f"{_SITE}{uuid4().hex}", traverse=False)


def _chunks(site: TiledMap) -> tuple[tuple[int, ...], ...]:
    return tuple(
        tuple(min(side, size - first) for first in range(0, size, side))
        for size, side in zip(site.size, site.tile, strict=True)
    )


def _blocks(
    function: Any, chunks: Any, dtype: type = np.float32, of: Any = None, **options: Any
) -> Any:
    """Return a Dask array of what a function returns for each chunk."""
    from dask.array import map_blocks

    # Without a name, Dask would hash what the function holds.
    name, meta = f"tiles-{uuid4().hex}", np.empty((0, 0), np.dtype(dtype))
    arrays = [] if of is None else [of]
    return map_blocks(
        function, *arrays, chunks=chunks, dtype=dtype, meta=meta, name=name, **options
    )


def _read(name: str, site: TiledMap, block_id: Size) -> Layer:
    (layer,) = site.source.read(_window(site, block_id), [name])
    return layer


def _read_all(names: Sequence[str], site: TiledMap, block_id: Size) -> NDArray[np.object_]:
    """Return the layers of a tile in an array of one element, as Dask wants blocks."""
    result = np.empty((1, 1), object)
    result[0, 0] = site.source.read(_window(site, block_id), names)
    return result


def _window(site: TiledMap, block_id: Size) -> Window:
    return site.tiles[block_id[0] * site.tiles.counts[1] + block_id[1]]


def _one_of(number: int, tile: NDArray[np.object_]) -> Layer:
    layer: Layer = tile[0, 0][number]
    return layer
