# SPDX-License-Identifier: BSD-3-Clause
"""Latitude and longitude in the reference system of a map, computed with PROJ."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Positions, as_array, as_positions
from ..errors import ConfigError, GeometryError, GridMapError, required, short
from ._source import TiledData

M = TypeVar("M", bound=TiledData)

_REMEDY = "pip install 'grid_map_core_py[geo]'"

_WGS_84 = "EPSG:4326"


def position_of(crs: str, latitude: ArrayLike, longitude: ArrayLike) -> Positions:
    """Return positions in a reference system; see `TiledMap.position_of`."""
    angles = (
        as_array(longitude, np.float64, "longitude"),
        as_array(latitude, np.float64, "latitude"),
    )
    if angles[0].shape != angles[1].shape or angles[0].ndim > 1:
        found = f"{short(latitude)} and {short(longitude)}"
        raise GeometryError(f"latitude, longitude: expected two numbers or two (N,), got {found}")
    return _finite(_transformer(crs).transform(*angles))


def latitude_longitude_of(crs: str, positions: ArrayLike) -> Positions:
    """Return places on the earth; see `TiledMap.latitude_longitude_of`."""
    x, y = np.moveaxis(as_positions(positions), -1, 0)
    longitude, latitude = _transformer(crs).transform(x, y, direction="INVERSE")
    return _finite((latitude, longitude))


def moved_map(tiled_map: M, origin: ArrayLike) -> M:
    """Return a map in the frame whose origin is at a position in its present frame [m]."""
    x, y = np.asarray(origin, np.float64).tolist()
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ConfigError("origin: expected a place with coordinates in the reference system")
    geometry = tiled_map.geometry.at(tiled_map.position - np.array([x, y]))
    return replace(
        tiled_map, geometry=geometry, origin=(tiled_map.origin[0] + x, tiled_map.origin[1] + y)
    )


def _finite(coordinates: tuple[ArrayLike, ArrayLike]) -> Positions:
    """Return pairs (2,) or (N, 2); those outside the reference system are NaN."""
    pairs = np.stack([np.asarray(one, np.float64) for one in coordinates], axis=-1)
    pairs[~np.isfinite(pairs).all(axis=-1)] = np.nan
    return pairs


@lru_cache(maxsize=16)
def _transformer(crs: str) -> Any:
    """Return the PROJ transformer from longitude and latitude into a reference system."""
    if not crs:
        raise GridMapError(
            "the map has no reference system, so its place on the earth is not known; a GeoTIFF "
            "file or a store says it, or 'dataclasses.replace(tiled_map, crs=...)'"
        )
    proj = required("pyproj", "latitude and longitude", _REMEDY)
    return proj.Transformer.from_crs(_WGS_84, crs, always_xy=True)
