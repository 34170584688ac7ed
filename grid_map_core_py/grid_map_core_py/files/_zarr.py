# SPDX-License-Identifier: BSD-3-Clause
"""Zarr stores as a file format: whole maps, within the limits; see `grid_map_core_py.tiled`."""

from collections.abc import Iterable
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import Any

from ..map._grid_map import GridMap
from ._shared import map_facts

_FILES = (".zgroup", "zarr.json")


def is_store(path: str | PathLike[str]) -> bool:
    """Return whether a path is a Zarr store by its name, or by the files in it."""
    found = Path(path)
    return found.suffix.lower() == ".zarr" or any((found / name).is_file() for name in _FILES)


def load_zarr(path: str | PathLike[str], layers: Iterable[str] | None = None) -> GridMap:
    """Return the map in a Zarr store, if the limits allow its size.

    Args:
        path: the folder of the store, or its address.
        layers: names of the layers to read; None means all.

    Raises:
        LayerNotFoundError: the store lacks one of the layers.
        LimitError: the map has more cells than the limits allow.
        GridMapError: the store cannot be read.
    """
    from ..tiled import open_map

    return open_map(path).to_map(layers)


def save_zarr(
    grid_map: GridMap, path: str | PathLike[str], *, chunks: int = 1024, crs: str = ""
) -> None:
    """Write a map into a Zarr store, which replaces one that is there.

    Args:
        grid_map: the map.
        path: the folder of the store.
        chunks: side of a chunk [cells].
        crs: coordinate reference system of the frame, as text.

    Raises:
        GridMapError: a layer has a name that a store cannot hold, or the store cannot be written.
    """
    from ..tiled import open_map

    open_map(grid_map.to_xarray(crs=crs), chunks=chunks).to_zarr(path, overwrite=True)


def describe_zarr(path: str | PathLike[str]) -> dict[str, Any]:
    """Return what a store tells about its map; no layer is read."""
    from ..tiled import open_map

    site = open_map(path)
    empty = GridMap.from_geometry(site.geometry, frame_id=site.frame_id, timestamp=site.timestamp)
    names = {"layers": [*site.layers], "basic_layers": [*site.basic_layers]}
    crs = {"crs": _short(site.crs)} if site.crs else {}
    facts = crs | map_facts(empty) | names | {"chunks": [*site.tile]}
    # Counting the files of a store may take minutes.
    return {"bytes": None, "map": facts}


def _short(crs: str) -> str:
    """Return the code of a reference system, or itself if it has none."""
    with suppress(Exception):
        from pyproj import CRS

        return ":".join(CRS.from_user_input(crs).to_authority() or [crs])
    return crs
