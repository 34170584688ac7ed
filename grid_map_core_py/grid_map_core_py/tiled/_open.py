# SPDX-License-Identifier: BSD-3-Clause
"""`open_map`: stores, rasters and datasets as tiled maps; stores as files of `load` and `save`."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files._formats import Format
from ..files._shared import map_facts
from ..map._grid_map import GridMap
from ..plugins import check
from ._source import TILE
from ._tiled_map import TiledMap

if TYPE_CHECKING:
    import xarray


def open_map(
    path: "str | PathLike[str] | Sequence[str | PathLike[str]] | xarray.Dataset",
    *,
    chunks: int | None = None,
    crs: str = "",
    origin: tuple[float, float] | None = None,
) -> TiledMap:
    """Return a map of any size; nothing but its description is read.

    Several GeoTIFF files are one map if their pixels are on one grid: gaps are NaN, and where files
    overlap, the first one with a value wins.

    Args:
        path: a Zarr store (a folder, or an address that fsspec knows), GeoTIFF files (also virtual
            ones of GDAL, such as `/vsicurl/https://.../dem.tif`), or a dataset of xarray.
        chunks: side of the tiles that are computed and written at once [cells]; by default the
            chunks of the store, otherwise 1024.
        crs: coordinate reference system, such as "EPSG:25832", into which GeoTIFF files are
            projected when they are read: by bilinear interpolation, to square pixels.
        origin: latitude and longitude [deg, WGS 84] of the place that is (0, 0) in the frame; None
            takes the coordinates of the reference system. See `TiledMap.with_origin`.

    Raises:
        ConfigError: `crs` is of another form, or given for another kind of map.
        MissingPackageError: a package that the kind of map needs is not installed.
        GridMapError: it cannot be read, or is no map.
    """
    check(chunks is None or chunks >= 1, "chunks", "a number of cells", chunks)
    site = _opened(path, chunks, crs)
    return site if origin is None else site.with_origin(*origin)


def _opened(path: Any, chunks: int | None, crs: str) -> TiledMap:
    side = (chunks, chunks) if chunks else None
    is_name, is_dataset = isinstance(path, str | PathLike), hasattr(path, "dims")
    if not is_dataset and (not is_name or Path(path).suffix.lower() in (".tif", ".tiff")):
        from ._rasters import open_rasters

        paths = [path] if is_name else [*path]
        check(bool(paths), "path", "a file at least", paths)
        return open_rasters(paths, side or (TILE, TILE), crs)
    check(not crs, "crs", "none: only GeoTIFF files are projected when they are read", crs)
    if is_dataset:
        from ._xarray import open_dataset

        return open_dataset(path, side)
    from ._stores import open_store

    return open_store(fspath(path), chunks)


# --- the file format ------------------------------------------------------------------------------


def _load(path: str | PathLike[str], layers: Iterable[str] | None = None) -> GridMap:
    return open_map(path).to_map(layers)


def _save(
    grid_map: GridMap, path: str | PathLike[str], *, chunks: int = 1024, crs: str = ""
) -> None:
    """Write a map into a Zarr store, which replaces one that is there.

    Args:
        grid_map: the map.
        path: the folder of the store.
        chunks: side of a chunk [cells].
        crs: coordinate reference system of the frame, as text.
    """
    open_map(grid_map.to_xarray(crs=crs), chunks=chunks).to_zarr(path, overwrite=True)


def _describe(path: str | PathLike[str]) -> dict[str, Any]:
    site = open_map(path)
    empty = GridMap.from_geometry(site.geometry, frame_id=site.frame_id, timestamp=site.timestamp)
    names = {"layers": [*site.layers], "basic_layers": [*site.basic_layers]}
    crs = site.crs
    with suppress(Exception):  # pyproj is not installed, or the system has no code.
        from pyproj import CRS

        crs = ":".join(CRS.from_user_input(crs).to_authority())
    facts = ({"crs": crs} if crs else {}) | map_facts(empty) | names | {"chunks": [*site.tile]}
    # Counting the files of a store may take minutes.
    return {"bytes": None, "map": facts}


ZARR = Format(
    name="zarr",
    description="Zarr store of layers in chunks, for maps of any size",
    endings=(".zarr",),
    reads=lambda path: (
        path.suffix.lower() == ".zarr"
        or any(Path(path, name).is_file() for name in (".zgroup", "zarr.json"))
    ),
    load=_load,
    save=_save,
    describe=_describe,
)
