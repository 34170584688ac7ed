# SPDX-License-Identifier: BSD-3-Clause
"""Maps of all kinds that pictures show, and the meaning of their layers.

These are maps in memory, tiled maps, and datasets and arrays of xarray. Tiled maps and datasets may
know the reference system of their frame; a `GridMap` does not.
"""

import math
import re
from typing import TYPE_CHECKING, Any, TypeAlias

from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check

if TYPE_CHECKING:
    import xarray

    from grid_map_core_py import GridMap
    from grid_map_core_py.tiled import TiledMap

AnyMap: TypeAlias = "GridMap | TiledMap | xarray.Dataset | xarray.DataArray"

_HEIGHTS = re.compile(r"(elevation|heights?|altitude|dem|dsm|dtm)(?![a-z])", re.IGNORECASE)
_NO_HEIGHTS = re.compile(r"color|count|curvature|deviation|error|normal|slope|std|time|variance")


def opened(grid_map: AnyMap) -> "GridMap | TiledMap":
    """Return a map in memory as it is, and anything else as a tiled map."""
    # Slow to import.
    from grid_map_core_py import GridMap

    if isinstance(grid_map, GridMap):
        return grid_map
    from grid_map_core_py.tiled import TiledMap, open_map

    if isinstance(grid_map, TiledMap):
        return grid_map
    source: Any = grid_map
    expected = "a GridMap, a TiledMap, or a Dataset or DataArray of xarray"
    check(hasattr(source, "dims"), "grid_map", expected, source)
    return open_map(source)


def loaded(site: "GridMap | TiledMap", layers: set[str], cells: float) -> "GridMap":
    """Return a map with some layers in memory.

    Args:
        site: a map in memory is returned as it is; of a tiled map every n-th cell, or the cells of
            an overview, so that they are at least as many as asked for.
        layers: names of the layers.
        cells: number of cells that the picture shows; infinite for all.
    """
    from grid_map_core_py import GridMap

    if isinstance(site, GridMap):
        return site
    names = [name for name in site.layers if name in layers] + sorted(layers - {*site.layers})
    steps = math.floor(math.log2(max(1.0, site.size[0] * site.size[1] / cells)) / 2)
    return site.thinned(2**steps, names) if steps else site.to_map(names)


def usual_layer(site: "GridMap | TiledMap") -> str:
    """Return the layer that is drawn unless the user names one: elevation, or the first.

    Raises:
        ConfigError: the map has no layers.
    """
    if not site.layers:
        raise ConfigError("the map has no layers")
    return "elevation" if "elevation" in site.layers else site.layers[0]


def is_heights(layer: str) -> bool:
    """Return whether the name of a layer says that it holds heights."""
    return bool(_HEIGHTS.match(layer)) and not _NO_HEIGHTS.search(layer)


def titled(layer: str) -> str:
    """Return the name of a layer, with the unit if its name says that it holds heights."""
    return f"{layer} [m]" if is_heights(layer) else layer


def lit_heights(site: "GridMap | TiledMap", layer: str, hillshade: bool | str | None) -> str:
    """Return the layer of heights that the light falls on; empty for no light.

    Raises:
        ConfigError: `hillshade` is true, and no name of a layer says that it holds heights.
    """
    if isinstance(hillshade, str):
        return hillshade
    if is_heights(layer) and hillshade is not False:
        return layer
    if not hillshade:
        return ""
    usual = [usual_layer(site), *site.layers]
    found = next(filter(is_heights, usual), "")
    expected = f"a layer of heights, one of {', '.join(site.layers)}"
    check(bool(found), "hillshade", expected, hillshade)
    return found
