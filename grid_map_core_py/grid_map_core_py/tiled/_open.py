# SPDX-License-Identifier: BSD-3-Clause
"""Opens stores, rasters and datasets as tiled maps."""

from collections.abc import Iterable, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..files._formats import Format
from ..files._geotiff import checked_crs
from ..files._shared import map_facts
from ..map._grid_map import GridMap
from ..plugins import check
from ._datasets import open_dataset
from ._source import TILE
from ._tiled_map import TiledMap, register
from ._zarr_source import open_store

if TYPE_CHECKING:
    import xarray


def open_map(
    path: "str | PathLike[str] | Sequence[str | PathLike[str]] | xarray.Dataset",
    *,
    chunks: int | None = None,
    crs: Any = "",
    origin: tuple[float, float] | None = None,
) -> TiledMap:
    """Open a map of any size and read only the metadata.

    Several GeoTIFF files form one map if their pixels lie on the same grid. Gaps between files are
    NaN. If files overlap, a cell gets its value from the first file with data in this cell.

    Args:
        path: a Zarr store (a folder or an fsspec URL), one or more GeoTIFF files, or an xarray
            dataset. GeoTIFF files may be GDAL virtual files such as `/vsicurl/https://.../dem.tif`.
        chunks: side of the tiles in which the map is computed and written [cells]. None means the
            chunk size of the store or of the Dask arrays, or 1024 for data without chunks.
        crs: coordinate reference system of the map, such as "EPSG:25832". GeoTIFF files are
            reprojected to this system on read, with bilinear interpolation and square pixels.
        origin: latitude and longitude of the map frame origin [deg, WGS 84]. None means the stored
            origin or, if none is stored, the origin of the reference system. See
            `TiledMap.with_origin`.

    Raises:
        ConfigError: `crs` is malformed, or is given for a map that is not a GeoTIFF file.
        MissingPackageError: a package required for this kind of map is not installed.
        GridMapError: `path` cannot be read or is not a map.
    """
    check(chunks is None or chunks >= 1, "chunks", "a number of cells", chunks)
    side = (chunks, chunks) if chunks else None
    source: Any = path
    is_name, is_dataset = isinstance(path, str | PathLike), hasattr(path, "dims")
    if not is_dataset and (not is_name or Path(source).suffix.lower() in (".tif", ".tiff")):
        from ._rasters import open_rasters

        paths = [source] if is_name else [*source]
        check(bool(paths), "path", "at least one file", paths)
        data = open_rasters(paths, side or (TILE, TILE), checked_crs(crs))
    else:
        check(not crs, "crs", "none: only GeoTIFF files are projected when they are read", crs)
        data = open_dataset(source, side) if is_dataset else open_store(fspath(source), chunks)
        register()
    opened = TiledMap(**vars(data))
    return opened if origin is None else opened.with_origin(*origin)


# --- the file format ------------------------------------------------------------------------------


def _load(path: str | PathLike[str], layers: Iterable[str] | None = None) -> GridMap:
    return open_map(path).to_map(layers)


def _save(
    grid_map: GridMap, path: str | PathLike[str], *, chunks: int = 1024, crs: Any = ""
) -> None:
    opened = open_map(grid_map.to_xarray(crs=crs), chunks=chunks)
    opened.to_zarr(path, overwrite=True)


def _describe(path: str | PathLike[str]) -> dict[str, Any]:
    opened = open_map(path)
    names = {"layers": [*opened.layers], "basic_layers": [*opened.basic_layers]}
    facts = map_facts(opened._map(opened.geometry, (), [])) | names
    # Counting the files of a store may take minutes.
    return {"bytes": None, "map": facts | {"chunks": [*opened.tile]}}


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
