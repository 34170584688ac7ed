# SPDX-License-Identifier: BSD-3-Clause
"""Infers the content of a layer, such as heights, from its name."""

import re
from typing import TYPE_CHECKING

from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check

if TYPE_CHECKING:
    from grid_map_core_py import GridMap
    from grid_map_core_py.tiled import TiledMap

_HEIGHTS = re.compile(r"(elevation|heights?|altitude|dem|dsm|dtm)(?![a-z])", re.IGNORECASE)
_SLOPES = re.compile(r"slope(?![a-z])(?!.*(color|deg|percent|std|variance))", re.IGNORECASE)
_NO_HEIGHTS = re.compile(r"color|count|curvature|deviation|error|normal|slope|std|time|variance")


def usual_layer(site: "GridMap | TiledMap") -> str:
    """Return the layer to draw by default: `elevation`, or else the first layer."""
    if not site.layers:
        raise ConfigError("the map has no layers")
    return "elevation" if "elevation" in site.layers else site.layers[0]


def is_heights(layer: str) -> bool:
    return bool(_HEIGHTS.match(layer)) and not _NO_HEIGHTS.search(layer)


def titled(layer: str, label: str = "", *, is_empty: bool = False) -> str:
    """Return the title of a color bar: `label`, or else the layer name with its unit."""
    unit = " [m]" if is_heights(layer) else " [rad]" if _SLOPES.match(layer) else ""
    return (label or layer + unit) + (": all cells unknown" if is_empty else "")


def lit_heights(site: "GridMap | TiledMap", layer: str, hillshade: bool | str | None) -> str:
    """Return the height layer used to shade `layer`, or "" if `layer` is not shaded."""
    if isinstance(hillshade, str):
        return hillshade
    if is_heights(layer) and hillshade is not False:
        return layer
    if not hillshade:
        return ""
    found = next(filter(is_heights, [usual_layer(site), *site.layers]), "")
    expected = f"a layer of heights, one of {', '.join(site.layers)}"
    check(bool(found), "hillshade", expected, hillshade)
    return found
