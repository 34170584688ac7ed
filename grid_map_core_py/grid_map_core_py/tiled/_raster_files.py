# SPDX-License-Identifier: BSD-3-Clause
"""Writes tiled maps to GeoTIFF files window by window, and builds overviews afterwards."""

import itertools
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from os import PathLike
from pathlib import Path

import numpy as np

from .._arrays._checks import Layer
from .._unfinished import unfinished
from ..errors import GridMapError
from ..files._atomic import new_file
from ..files._geotiff import describe_raster, gdal, raster_profile
from ..files._image_files import to_north_up
from ..files._shared import check_ending, storage_errors
from ._engine import in_any_order
from ._source import Progress, TiledData, Tiles, Window

_BLOCK = 512
"""Side of a block of a file [cells]."""


def to_geotiff(
    tiled_map: TiledData,
    path: str | PathLike[str],
    names: Sequence[str],
    progress: Progress | None,
    *,
    cog: bool,
    compress: bool,
    overwrite: bool,
) -> None:
    """Write a tiled map into a GeoTIFF file; see `TiledMap.to_geotiff`."""
    target = Path(path)
    check_ending(target, ".tif", ".tiff")
    # Auxiliary files would be left beside the temporary one.
    with gdal(target, GDAL_PAM_ENABLED=False), storage_errors(target, "written"):
        if not names:
            raise GridMapError("the map has no layers")
        if target.exists() and not overwrite:
            raise GridMapError("exists already; 'overwrite' replaces it")
        tiled_map.source.prepare()
        with new_file(target) as file:
            if not cog:
                _write_windows(tiled_map, file, names, progress, compress=compress)
            else:
                with unfinished(file.with_name(f"{file.name}.tiles")) as tiles:
                    _write_windows(tiled_map, tiles, names, progress, compress=False)
                    _check_complete(tiles)
                    _copy_as_cog(tiles, file, compress=compress)
            _check_complete(file)


def _write_windows(
    tiled_map: TiledData,
    file: Path,
    names: Sequence[str],
    progress: Progress | None,
    *,
    compress: bool,
) -> None:
    """Write the layers into a file of blocks."""
    crs, origin = tiled_map.crs, tiled_map.origin
    geometry = tiled_map.geometry.at(tiled_map.position + origin)
    profile = raster_profile(geometry, len(names), crs, compress=compress)
    profile |= {"tiled": True, "blockxsize": _BLOCK, "blockysize": _BLOCK, "interleave": "band"}
    facts = {
        "frame_id": tiled_map.frame_id,
        "timestamp": tiled_map.timestamp,
        "basic_layers": [name for name in tiled_map.basic_layers if name in names],
    }
    # Whole blocks, which are packed only once.
    width, height = (-(-side // _BLOCK) * _BLOCK for side in tiled_map.tile)
    windows = Tiles((tiled_map.size[1], tiled_map.size[0]), (height, width))
    rectangle = import_module("rasterio.windows").Window.from_slices
    with import_module("rasterio").open(file, "w", **profile) as raster:
        describe_raster(
            raster, names, facts | ({"origin": origin, "crs": crs} if any(origin) else {})
        )
        if progress is not None:
            progress(0, len(windows))
        parts = in_any_order(partial(_compute, tiled_map, names), windows)
        for done, (window, layers) in enumerate(parts, 1):
            raster.write(np.stack([*map(to_north_up, layers)]), window=rectangle(*window))
            if progress is not None:
                progress(done, len(windows))


def _compute(tiled_map: TiledData, names: Sequence[str], window: Window) -> list[Layer]:
    """Return the layers of a window of raster lines and pixels."""
    lines, pixels = window
    rows = slice(tiled_map.size[0] - pixels.stop, tiled_map.size[0] - pixels.start)
    return tiled_map.source.read((rows, lines), names)


def _copy_as_cog(tiles: Path, file: Path, *, compress: bool) -> None:
    """Build the overviews of a tiled file, and copy it with the layout of a COG."""
    with import_module("rasterio").open(tiles, "r+") as raster:
        levels = range(1, max(0, (max(raster.shape) - 1) // _BLOCK).bit_length() + 1)
        # The nearest of four heights would be one of them by chance.
        average = import_module("rasterio.enums").Resampling.average
        raster.build_overviews([2**level for level in levels], average)
    packing = {"COMPRESS": "DEFLATE", "PREDICTOR": "YES"} if compress else {"COMPRESS": "NONE"}
    import_module("rasterio.shutil").copy(
        tiles,
        file,
        driver="COG",
        BLOCKSIZE=_BLOCK,
        BIGTIFF="IF_SAFER",
        NUM_THREADS="ALL_CPUS",
        **packing,
    )


def _check_complete(file: Path) -> None:
    """Raise `OSError` if a block is missing: GDAL reports no error if it closes on a full disk."""
    length = file.stat().st_size
    with import_module("rasterio").open(file) as raster:
        levels = [(None, 1), *enumerate(raster.overviews(1))]
        for band, (level, factor) in itertools.product(raster.indexes, levels):
            counts = (-(-side // (factor * _BLOCK)) for side in raster.shape)
            for row, column in np.ndindex(*counts):
                offset, size = (
                    raster.get_tag_item(f"BLOCK_{kind}_{column}_{row}", "TIFF", band, level)
                    for kind in ("OFFSET", "SIZE")
                )
                if offset is None or int(offset) + int(size) > length:
                    raise OSError("a block is missing, perhaps because the disk is full")
