# SPDX-License-Identifier: BSD-3-Clause
"""Latitude and longitude in the reference system of a map, computed with PROJ."""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Positions, as_array, as_positions
from ..errors import ConfigError, GeometryError, GridMapError, required, short

if TYPE_CHECKING:
    from ._tiled_map import TiledMap

_REMEDY = "pip install 'grid_map_core_py[geo]'"

_WGS_84 = "EPSG:4326"

_FALSE = ({8806, 8816, 8826}, {8807, 8817, 8827})
"""EPSG codes of the projection parameters that are added to x and to y."""

_AXES = (
    {"name": "Easting", "abbreviation": "E", "direction": "east"},
    {"name": "Northing", "abbreviation": "N", "direction": "north"},
)

_MOVED = re.compile(r"moved by (\S+), (\S+) from (.+)", re.DOTALL)
"""Remark in a reference system whose origin was moved."""


def position_of(crs: str, latitude: ArrayLike, longitude: ArrayLike) -> Positions:
    """Return positions in a reference system; see `TiledMap.position_of`."""
    angles = (
        as_array(longitude, np.float64, "longitude"),
        as_array(latitude, np.float64, "latitude"),
    )
    if angles[0].shape != angles[1].shape or angles[0].ndim > 1:
        found = f"{short(latitude)} and {short(longitude)}"
        raise GeometryError(f"latitude, longitude: expected two numbers or two (N,), got {found}")
    transformer, offset = _transformer(crs)
    return _finite(transformer.transform(*angles)) - offset


def latitude_longitude_of(crs: str, positions: ArrayLike) -> Positions:
    """Return places on the earth; see `TiledMap.latitude_longitude_of`."""
    transformer, offset = _transformer(crs)
    x, y = np.moveaxis(as_positions(positions) + offset, -1, 0)
    longitude, latitude = transformer.transform(x, y, direction="INVERSE")
    return _finite((latitude, longitude))


def moved_map(site: "TiledMap", origin: ArrayLike) -> "TiledMap":
    """Return a map in the frame whose origin is at a position in its present frame [m]."""
    crs = moved_crs(site.crs, origin)
    return replace(site, geometry=site.geometry.at(site.position - np.asarray(origin)), crs=crs)


def moved_crs(crs: str, origin: ArrayLike) -> str:
    """Return a reference system as WKT, with its origin moved to a position [m].

    A remark in it holds the offset and the original system, for `unmoved_crs`.

    Raises:
        GridMapError: the position is not finite, or the system is no projection.
    """
    x, y = np.asarray(origin, np.float64).tolist()
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ConfigError("origin: expected a place with coordinates in the reference system")
    base, (east, north) = unmoved_crs(crs)
    east, north = east + x, north + y
    proj = _pyproj()
    system = proj.CRS.from_user_input(base).to_json_dict()
    found = next(_projections(system), None)
    if found is None:
        raise GridMapError(f"origin: expected the map in a projection, got {short(base)}")
    axes, parameters = found["coordinate_system"]["axis"], found["conversion"]["parameters"]
    for numbers, offset in zip(_FALSE, (east, north), strict=True):
        values = [one for one in parameters if one.get("id", {}).get("code") in numbers]
        if len(values) != 1 or {"west"} & {axis["direction"] for axis in axes}:
            raise GridMapError(f"origin: the projection {found['name']} cannot be moved")
        values[0]["value"] -= offset * _meters(axes[0].get("unit")) / _meters(values[0].get("unit"))
    # Rasters have x first; without its number, PROJ does not know that a system differs.
    for axis, described in zip(axes, _AXES, strict=False):
        axis.update(described)
        axis.pop("meridian", None)
    for part in (system, found, found["conversion"]):
        part.pop("id", None)
        part["name"] = f"{part['name'].removesuffix(', moved')}, moved"
    system["remarks"] = f"moved by {east!r}, {north!r} from {base}"
    return str(proj.CRS.from_json_dict(system).to_wkt())


def unmoved_crs(crs: str) -> tuple[str, tuple[float, float]]:
    """Return the original reference system of a moved one, and the offset [m]."""
    if not re.search(r'REMARK\["moved by ', crs):
        return crs, (0.0, 0.0)
    found = _MOVED.fullmatch(_pyproj().CRS.from_user_input(crs).remarks)
    if found is None:
        return crs, (0.0, 0.0)
    east, north, base = found.groups()
    return base, (float(east), float(north))


def _projections(system: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the projected systems within a system, which may be compound or bound."""
    if system["type"] == "ProjectedCRS":
        yield system
    for part in (*system.get("components", ()), system.get("source_crs")):
        if part:
            yield from _projections(part)


def _meters(unit: Any) -> float:
    """Return the size of a unit [m]."""
    return float(unit["conversion_factor"]) if isinstance(unit, dict) else 1.0


def _finite(coordinates: tuple[ArrayLike, ArrayLike]) -> Positions:
    """Return pairs (2,) or (N, 2); those outside the reference system are NaN."""
    pairs = np.stack([np.asarray(one, np.float64) for one in coordinates], axis=-1)
    pairs[~np.isfinite(pairs).all(axis=-1)] = np.nan
    return pairs


@lru_cache(maxsize=16)
def _transformer(crs: str) -> tuple[Any, tuple[float, float]]:
    """Return a transformer of longitude and latitude, and the origin of the frame [m]."""
    if not crs:
        raise GridMapError(
            "the map has no reference system, so its place on the earth is not known; a GeoTIFF "
            "file or a store says it, or 'dataclasses.replace(site, crs=...)'"
        )
    # PROJ chooses among the transformations of a datum by the number of the system.
    base, origin = unmoved_crs(crs)
    return _pyproj().Transformer.from_crs(_WGS_84, base, always_xy=True), origin


def _pyproj() -> Any:
    return required("pyproj", "latitude and longitude", _REMEDY)
