# SPDX-License-Identifier: BSD-3-Clause
"""`open_map`: stores, rasters and datasets as tiled maps."""

from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    virtual: bool = False,
) -> TiledMap:
    """Return a map of any size; nothing but its description is read.

    Several GeoTIFF files are one map if their pixels are on one grid: gaps are NaN, and where files
    overlap, the first one with a value wins.

    Args:
        path: a Zarr store (a folder, or an address that fsspec knows), GeoTIFF files, or a dataset
            of xarray.
        chunks: side of the tiles that are computed and written at once [cells]; by default the
            chunks of the store, otherwise 1024.
        crs: coordinate reference system, such as "EPSG:25832", into which GeoTIFF files are
            projected when they are read: by bilinear interpolation, to square pixels.
        origin: latitude and longitude [deg, WGS 84] of the place that is (0, 0) in the frame; None
            takes the coordinates of the reference system. See `TiledMap.with_origin`.
        virtual: let paths name virtual files of GDAL, such as `/vsicurl/https://.../dem.tif`.

    Raises:
        ConfigError: `crs` is of another form, or given for another kind of map.
        MissingPackageError: a package that the kind of map needs is not installed.
        GridMapError: it cannot be read, or is no map.
    """
    check(chunks is None or chunks >= 1, "chunks", "a number of cells", chunks)
    site = _opened(path, chunks, crs, virtual=virtual)
    return site if origin is None else site.with_origin(*origin)


def _opened(path: Any, chunks: int | None, crs: str, *, virtual: bool) -> TiledMap:
    side = (chunks, chunks) if chunks else None
    is_name, is_dataset = isinstance(path, str | PathLike), hasattr(path, "dims")
    if not is_dataset and (not is_name or Path(path).suffix.lower() in (".tif", ".tiff")):
        from ._rasters import open_rasters

        paths = [path] if is_name else [*path]
        check(bool(paths), "path", "a file at least", paths)
        return open_rasters(paths, side or (TILE, TILE), crs, virtual=virtual)
    check(not crs, "crs", "none: only GeoTIFF files are projected when they are read", crs)
    if is_dataset:
        from ._xarray import open_dataset

        return open_dataset(path, side)
    from ._stores import open_store

    return open_store(fspath(path), chunks)
