# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`open_map`: stores, rasters and datasets as tiled maps."""

from collections.abc import Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import GridMapError, short
from ..plugins import check
from ._tiled_map import TiledMap

if TYPE_CHECKING:
    import xarray


def open_map(
    path: "str | PathLike[str] | Sequence[str | PathLike[str]] | xarray.Dataset",
    *,
    chunks: int | None = None,
) -> TiledMap:
    """Return a map of any size; nothing but its description is read.

    Args:
        path: a Zarr store (a folder, or an address that fsspec knows), GeoTIFF files, or a dataset
            of xarray.
        chunks: side of the tiles that are computed and written at once [cells]; by default the
            chunks of the store, otherwise 1024.

    Raises:
        MissingPackageError: a package that the kind of map needs is not installed.
        GridMapError: it cannot be read, or is no map.
    """
    check(chunks is None or chunks >= 1, "chunks", "a number of cells", chunks)
    if not isinstance(path, str | PathLike):
        dataset: Any = path
        if hasattr(dataset, "dims"):
            from ._xarray import open_dataset

            return open_dataset(dataset, (chunks, chunks) if chunks else None)
        return _open_rasters([*path], chunks)
    name = fspath(path)
    if Path(name).suffix.lower() in (".tif", ".tiff"):
        return _open_rasters([name], chunks)
    from ._stores import open_store

    return open_store(name, chunks)


def _open_rasters(paths: Sequence[Any], chunks: int | None) -> TiledMap:  # noqa: ARG001
    raise GridMapError(f"{short(paths)}: not yet")
