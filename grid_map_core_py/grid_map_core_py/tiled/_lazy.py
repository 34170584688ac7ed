# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Tiled maps as datasets of Dask arrays, with one chunk per tile.

One task computes a tile with all its layers, and one per layer takes it out, so that a tile is
computed once, however many of its layers are used.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from ..arrays._checks import Layer, Size, select_layers
from ..errors import required
from ._tiled_map import TiledMap
from ._xarray import attributes, dataset_of

if TYPE_CHECKING:
    import xarray

_REMEDY = "pip install 'grid_map_core_py[tiled]'"


def to_lazy_dataset(site: TiledMap, layers: Iterable[str] | None = None) -> "xarray.Dataset":
    """Return the dataset of a tiled map; see `TiledMap.to_xarray`."""
    arrays = required("dask.array", "a dataset that is computed later", _REMEDY)
    names = select_layers(site.layers, layers)
    site.source.prepare()
    rows, columns = sides = [
        tuple(min(side, size - first) for first in range(0, size, side))
        for size, side in zip(site.size, site.tile, strict=True)
    ]
    # Dask would look into the map for its name, and hash what it holds.
    common: dict[str, Any] = {"name": f"tiles-{uuid4().hex}", "meta": np.empty((0, 0), object)}
    ones = tuple((1,) * len(side) for side in sides)
    tiles = arrays.map_blocks(partial(_tile, site, names), chunks=ones, dtype=object, **common)
    meta = np.empty((0, 0), np.float32)
    lazy = {
        name: tiles.map_blocks(
            partial(_layer, number),
            chunks=(rows, columns),
            dtype=np.float32,
            meta=meta,
            name=f"layer-{uuid4().hex}",
        )
        for number, name in enumerate(names)
    }
    basic = [name for name in site.basic_layers if name in names]
    about = attributes(site.geometry, site.frame_id, site.timestamp, basic)
    return dataset_of(site.geometry, lazy, about, site.crs)


def _tile(site: TiledMap, names: Sequence[str], block_id: Size) -> NDArray[np.object_]:
    """Return the layers of a tile in an array of one element, as Dask wants blocks."""
    row, column = block_id
    result = np.empty((1, 1), object)
    result[0, 0] = site.source.read(site.tiles[row * site.tiles.counts[1] + column], names)
    return result


def _layer(number: int, tile: NDArray[np.object_]) -> Layer:
    layer: Layer = tile[0, 0][number]
    return layer
