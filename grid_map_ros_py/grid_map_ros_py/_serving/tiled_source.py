# SPDX-License-Identifier: BSD-3-Clause
"""Maps of any size, also beyond memory, as sources of nodes, and windows around a robot."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Size
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import check
from grid_map_core_py.tiled import TiledMap, open_map

from ..nodes import ConfiguredNode, read_parameter


def read_source(node: ConfiguredNode) -> Callable[[], TiledMap] | None:
    """Return a function that opens the map in the parameter `source`; None without a source."""
    kind: Any = str | list[str]
    about = (
        "map of any size, of which parts are read: a Zarr store, a GeoTIFF file or a list of "
        "them; empty means none"
    )
    source = read_parameter(node, "source", kind, "", description=about)
    about = "frame of the source; empty means as stored"
    frame_id = node.read("frame_id", "", about)
    about = (
        "latitude and longitude [deg, WGS 84] of the origin of the frame, for a source with "
        "coordinates of the earth; empty means that of the source"
    )
    origin = read_parameter(node, "origin", list[float], [], description=about)
    fits = len(origin) in (0, 2) and bool(np.isfinite(origin).all())
    check(fits, "origin", "a latitude and a longitude, or nothing", origin)
    return partial(open_source, source, frame_id, origin) if source else None


def open_source(
    source: str | list[str], frame_id: str = "", origin: Sequence[float] = ()
) -> TiledMap:
    """Return a map of any size, of which only the description is read.

    Args:
        source: path of a Zarr store or of a raster, or paths of rasters.
        frame_id: frame of the map; empty means as stored.
        origin: latitude and longitude [deg] of the origin of the frame; empty means that of the
            reference system of the source.
    """
    tiled_map = open_map(source)
    if origin:
        tiled_map = tiled_map.with_origin(*origin)
    return replace(tiled_map, frame_id=frame_id) if frame_id else tiled_map


def window(tiled_map: TiledMap, position: ArrayLike, size: Size, layers: Sequence[str]) -> GridMap:
    """Return a part of a map with a constant size, centered as near to a position as possible.

    Its cells are cells of the map; those off the map are NaN.

    Args:
        tiled_map: the map.
        position: (2,) x, y [m], on the map or off it.
        size: rows and columns of the window.
        layers: names of the layers to read.
    """
    check_cells("window", size, len(layers))
    first = tiled_map.geometry.cropped(*(slice(0, count) for count in size))
    shift = first.index_shift(position)
    stored, kept = [], []
    for start, count, cells in zip(shift, size, tiled_map.size, strict=True):
        stored.append(slice(max(start, 0), min(start + count, cells)))
        kept.append(slice(stored[-1].start - start, stored[-1].stop - start))
    grid_map = GridMap.from_geometry(first.shifted(shift), frame_id=tiled_map.frame_id)
    grid_map = grid_map.with_layers(
        {name: np.full(size, np.nan, np.float32, order="F") for name in layers}
    )
    grid_map.basic_layers = [name for name in tiled_map.basic_layers if name in layers]
    if all(part.start < part.stop for part in stored):
        block = tiled_map.get_block(stored[0], stored[1], layers)
        for name in layers:
            grid_map[name][kept[0], kept[1]] = block[name]
    return grid_map
