# SPDX-License-Identifier: BSD-3-Clause
"""Tiled maps as datasets of Dask arrays, with one chunk per tile.

One task computes a tile with all its layers, and further tasks take a layer out of it, so that a
tile is computed once, however many of its layers are used. Layers that are only read have tasks of
their own, so that reading one layer does not read the others.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any
from uuid import uuid4
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Size, select_layers
from ..errors import required
from ._datasets import attributes, dataset_of
from ._engine import REMEDY
from ._source import TiledData

if TYPE_CHECKING:
    import xarray

_ORIGINS = WeakValueDictionary[tuple[str, str], TiledData]()
"""Tiled maps by the names of layers and of their Dask arrays."""


def to_lazy_dataset(tiled_map: TiledData, layers: Iterable[str] | None = None) -> "xarray.Dataset":
    """Return the dataset of a tiled map; see `TiledMap.to_xarray`."""
    required("dask.array", "a dataset that is computed later", REMEDY)
    from dask.array import map_blocks
    from dask.delayed import delayed

    names = select_layers(tiled_map.layers, layers)
    source = tiled_map.source
    source.prepare()
    chunks = tuple(
        tuple(min(side, size - first) for first in range(0, size, side))
        for size, side in zip(tiled_map.size, tiled_map.tile, strict=True)
    )
    # A key of the graph of its own: a cluster sends the map to each worker once.
    known = delayed(tiled_map, name=f"map-{uuid4().hex}", traverse=False)
    arrays: dict[str, Any] = {}
    for group in [[n] for n in names] if getattr(source, "reads_layers_alone", False) else [names]:
        # Without names, Dask would hash what the functions hold.
        tiles = map_blocks(
            partial(_read, group),
            chunks=tuple((1,) * len(side) for side in chunks),
            dtype=object,
            meta=np.empty((0, 0), object),
            name=f"tiles-{uuid4().hex}",
            tiled_map=known,
        )
        for number, name in enumerate(group):
            arrays[name] = map_blocks(
                lambda tile, number=number: tile[0, 0][number],
                tiles,
                chunks=chunks,
                dtype=np.float32,
                meta=np.empty((0, 0), np.float32),
                name=f"layer-{uuid4().hex}",
            )
    about = tiled_map.frame_id, tiled_map.timestamp, tiled_map.basic_layers, tiled_map.origin
    described = attributes(tiled_map.geometry, names, *about)
    dataset = dataset_of(tiled_map.geometry, arrays, described, tiled_map.crs)
    remember(dataset, tiled_map)
    return dataset


def _read(names: Sequence[str], tiled_map: TiledData, block_id: Size) -> NDArray[np.object_]:
    """Return the layers of a tile in an array of one element, the form of blocks in Dask."""
    tiles, result = tiled_map.tiles, np.empty((1, 1), object)
    window = tiles[block_id[0] * tiles.counts[1] + block_id[1]]
    result[0, 0] = tiled_map.source.read(window, names)
    return result


def remember(dataset: "xarray.Dataset", tiled_map: TiledData) -> None:
    """Remember the map of the lazy layers of a dataset, whatever the order of its cells."""
    for name in {*tiled_map.layers} & {*dataset}:
        _ORIGINS[name, dataset[name].data.name] = tiled_map


def origin_of(dataset: "xarray.Dataset", layers: Sequence[str]) -> TiledData | None:
    """Return the map whose layers these are, all of them, unchanged and not yet computed.

    Windows of the map cost less than windows of Dask arrays, which compute all tiles around.
    """
    arrays = {name: dataset[name].data for name in layers if dataset[name].chunks}
    found = {_ORIGINS.get((name, array.name)) for name, array in arrays.items()}
    (tiled_map,) = found if len(found) == 1 else (None,)
    if tiled_map is None or tuple(layers) != tiled_map.layers or len(arrays) != len(layers):
        return None
    # An array that has been computed and kept has one layer in its graph.
    return tiled_map if all(len(array.dask.layers) > 1 for array in arrays.values()) else None
