# SPDX-License-Identifier: BSD-3-Clause
"""Maps larger than memory as sources of nodes: their parameters, and windows around a robot."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Size
from grid_map_core_py.limits import check_cells
from grid_map_core_py.plugins import check
from grid_map_core_py.tiled import TiledMap, open_map

from ..nodes import ConfiguredNode, read_parameter


@dataclass(frozen=True)
class SourceSettings:
    """Which map of any size a node reads.

    Attributes:
        source: path of a Zarr store or of a raster, or paths of rasters; empty for none.
        frame_id: frame of the map; empty means as stored.
        origin: latitude and longitude [deg] of the origin of the frame; empty means that of the
            reference system of the source.
    """

    source: str | list[str]
    frame_id: str = ""
    origin: Sequence[float] = ()

    def open(self) -> TiledMap:
        """Return the map; only its description is read.

        Raises:
            ConfigError: there is no source.
            GridMapError: it cannot be read, or is no map.
            MissingPackageError: a package that this kind of map needs is not installed.
        """
        check(bool(self.source), "source", "a Zarr store or a GeoTIFF file", self.source)
        site = open_map(self.source)
        if self.origin:
            site = site.with_origin(*self.origin)
        return replace(site, frame_id=self.frame_id) if self.frame_id else site


def read_source(node: ConfiguredNode) -> SourceSettings:
    """Return the parameters of a node that name a map of any size."""
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
    return SourceSettings(source, frame_id, origin)


def window(site: TiledMap, position: ArrayLike, size: Size, layers: Sequence[str]) -> GridMap:
    """Return a part of a map that has the same size everywhere: cells off the map are NaN.

    Its cells are cells of the map. Its center is the one nearest to the position.

    Args:
        site: the map.
        position: (2,) x, y [m], on the map or off it.
        size: rows and columns of the window.
        layers: names of the layers to read.

    Raises:
        LimitError: the window has more cells than the limits allow.
        GridMapError: the map cannot be read.
    """
    check_cells("window", size, len(layers))
    first = site.geometry.cropped(*(slice(0, count) for count in size))
    shift = first.index_shift(position)
    stored, kept = [], []
    for start, count, cells in zip(shift, size, site.size, strict=True):
        stored.append(slice(max(start, 0), min(start + count, cells)))
        kept.append(slice(stored[-1].start - start, stored[-1].stop - start))
    grid_map = GridMap.from_geometry(first.shifted(shift), frame_id=site.frame_id)
    grid_map = grid_map.with_layers(
        {name: np.full(size, np.nan, np.float32, order="F") for name in layers}
    )
    grid_map.basic_layers = [name for name in site.basic_layers if name in layers]
    if all(part.start < part.stop for part in stored):
        block = site.block(stored[0], stored[1], layers)
        for name in layers:
            grid_map[name][kept[0], kept[1]] = block[name]
    return grid_map
