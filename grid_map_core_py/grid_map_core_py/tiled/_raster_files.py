# SPDX-License-Identifier: BSD-3-Clause
"""Tiled maps into GeoTIFF files, window by window; overviews are built afterwards."""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays._checks import Layer, Size
from .._unfinished import unfinished
from ..errors import GridMapError
from ..files._atomic import new_file
from ..files._geotiff import check_crs, raster_profile, raster_tags
from ..files._image_files import to_north_up
from ..files._shared import check_ending, package_for, storage_errors
from ._engine import in_any_order
from ._rasters import bound_cache
from ._source import Progress, TiledData, Tiles, Window

_BLOCK = 512
"""Side of a block of a file [cells]."""


def to_geotiff(
    site: TiledData,
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
    package_for(target, "GeoTIFF", "rasterio")
    check_crs(site.crs)
    with storage_errors(target, "written"):
        if not names:
            raise GridMapError("the map has no layers")
        if target.exists() and not overwrite:
            raise GridMapError("exists already; 'overwrite' replaces it")
        site.source.prepare()
        bound_cache()
        with new_file(target) as file:
            if not cog:
                sums = _write_windows(site, file, names, progress, compress=compress)
            else:
                with unfinished(file.with_name(f"{file.name}.tiles")) as tiles:
                    sums = _write_windows(site, tiles, names, progress, compress=False)
                    _copy_as_cog(tiles, file, compress=compress)
            _check_written(file, sums, site.crs)


class _Compute:
    """Computes a window and hands it to a function, or returns it to the process that has this."""

    def __init__(
        self, site: TiledData, names: Sequence[str], write: Callable[..., object] | None = None
    ) -> None:
        self.site, self.names, self.write = site, names, write

    def __call__(self, window: Window) -> list[Layer] | None:
        layers = self.site.source.read(_in_map(window, self.site.size), self.names)
        if self.write is None:
            return layers
        self.write(window, layers)
        return None

    def __reduce__(self) -> Any:
        # Other processes have no open file.
        return _Compute, (self.site, self.names)


def _write_windows(
    site: TiledData, file: Path, names: Sequence[str], progress: Progress | None, *, compress: bool
) -> list[tuple[Window, int]]:
    """Write the layers into a file of blocks; return the windows and their checksums."""
    blocks = {"tiled": True, "blockxsize": _BLOCK, "blockysize": _BLOCK, "interleave": "band"}
    crs, origin = site.crs, site.origin
    geometry = site.geometry.at(site.position + origin)
    profile = raster_profile(geometry, len(names), crs, compress=compress) | blocks
    basic = [name for name in site.basic_layers if name in names]
    frame = {"origin": origin, "crs": crs} if any(origin) else {}
    tags = raster_tags(site.frame_id, site.timestamp, basic, **frame)
    width, height = (-(-side // _BLOCK) * _BLOCK for side in site.tile)
    windows = Tiles(site.size[::-1], (height, width))
    with _gdal() as rasterio:
        raster = rasterio.open(file, "w", num_threads="all_cpus", **profile)
    with closing(_Raster(raster)) as target:
        with _gdal():
            raster.update_tags(**tags)
            raster.descriptions = names
        if progress is not None:
            progress(0, len(windows))
        parts = in_any_order(_Compute(site, names, target.write), windows)
        for done, (window, layers) in enumerate(parts, 1):
            if layers is not None:
                target.write(window, layers)
            if progress is not None:
                progress(done, len(windows))
    return target.sums


class _Raster:
    """A raster that threads write, until it is closed."""

    def __init__(self, raster: Any) -> None:
        self.raster = raster
        self.lock = threading.Lock()
        self.sums: list[tuple[Window, int]] = []
        """The windows that have been written, and their checksums."""

    def write(self, window: Window, layers: Sequence[Layer]) -> None:
        """Write the layers of a window of lines and pixels."""
        images = np.stack([to_north_up(layer) for layer in layers])
        with self.lock, _gdal():
            # After an error, threads may still compute.
            if not self.raster.closed:
                self.raster.write(images, window=_rectangle(window))
                self.sums.append((window, _sum(images)))

    def close(self) -> None:
        with self.lock, _gdal():
            self.raster.close()


def _copy_as_cog(tiles: Path, file: Path, *, compress: bool) -> None:
    """Build the overviews of a file of blocks, and copy it in the order of a COG."""
    with _gdal() as rasterio:
        with rasterio.open(tiles, "r+") as raster:
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


def _check_written(file: Path, sums: Sequence[tuple[Window, int]], crs: str) -> None:
    """Raise `GridMapError` unless the file holds what has been written.

    GDAL reports no error if the disk is full while it closes a file.
    """
    with _gdal() as rasterio, rasterio.open(file) as raster:
        if bool(raster.crs) != bool(crs):
            raise GridMapError("a GeoTIFF file cannot hold the reference system of the map")
        for window, expected in sums:
            if _sum(raster.read(window=_rectangle(window))) != expected:
                raise OSError("GDAL reads other values than it has written")
        for band, levels in enumerate(map(raster.overviews, raster.indexes), 1):
            for number, level in enumerate(levels):
                _check_overview(raster, band, number, level)


def _check_overview(raster: Any, band: int, number: int, level: int) -> None:
    """Raise `OSError` if a block of an overview is missing."""
    counts = (-(-side // (level * _BLOCK)) for side in raster.shape)
    for row, column in np.ndindex(*counts):
        place = f"BLOCK_OFFSET_{column}_{row}"
        if raster.get_tag_item(place, "TIFF", bidx=band, ovr=number) is None:
            raise OSError("a block of an overview is missing")


@contextmanager
def _gdal() -> Iterator[Any]:
    """Yield rasterio for writing, without auxiliary files; turn its errors into one."""
    rasterio = import_module("rasterio")
    try:
        with rasterio.Env(GDAL_PAM_ENABLED=False):
            yield rasterio
    except GridMapError:
        raise
    except Exception as error:
        text = f"GDAL failed, perhaps because the disk is full: {error}"
        raise GridMapError(text) from error


def _in_map(window: Window, size: Size) -> Window:
    """Return the rows and columns of a map under lines and pixels of its raster."""
    lines, pixels = window
    return slice(size[0] - pixels.stop, size[0] - pixels.start), lines


def _rectangle(window: Window) -> Any:
    return import_module("rasterio.windows").Window.from_slices(*window)


def _sum(images: Any) -> int:
    """Return the sum of the bits of all values."""
    return int(images.view(np.uint32).sum(dtype=np.uint64))
