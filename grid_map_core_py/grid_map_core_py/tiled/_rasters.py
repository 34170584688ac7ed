# SPDX-License-Identifier: BSD-3-Clause
"""Opens GeoTIFF rasters as tiled maps, and writes tiled maps to GeoTIFF files."""

import itertools
import math
import os
import shlex
import threading
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .._arrays._checks import Layer, Size
from .._unfinished import unfinished
from ..errors import GridMapError
from ..files._geotiff import (
    describe_raster,
    gdal,
    geometry_of,
    open_raster,
    origin_of,
    raster_profile,
    read_pixels,
    stored_map,
    unit_of,
)
from ..files._image_files import to_north_up
from ..files._shared import StoredMap, check_ending, new_file, storage_errors
from ..map._geometry import GridGeometry
from ._engine import in_any_order
from ._source import Progress, TiledData, Tiles, Window, common, shape, within

if TYPE_CHECKING:
    from ._tiled_map import TiledMap

_LARGEST_SHIFT = 1e-3  # maximum misalignment between a raster and the grid of the mosaic [cells]
_LARGEST_DIFFERENCE = 1e-6  # maximum relative difference between pixel sizes in a mosaic
_MOST_OPEN = 64  # maximum number of rasters that a process keeps open

_WIDEST_STRIP = 8192
"""Width of compressed strips above which opening a raster warns of slow windows [pixels]."""

_WARPING: dict[str, Any] = {
    "dtype": "float32",
    "nodata": math.nan,
    "tolerance": 0.01,
    # By default, the size of the interpolation kernel depends on the window.
    "XSCALE": 1,
    "YSCALE": 1,
    # By default, a nodata value becomes NaN only where no other band has a value.
    "UNIFIED_SRC_NODATA": "NO",
}
"""GDAL options for projected rasters; `tolerance` is the allowed position error [pixels]."""

_BLOCK = 256
"""Side of the blocks in which a raster is projected [cells].

GDAL approximates the projection separately in each window. With fixed blocks, cell values do not
depend on the window that is read.
"""


_FILE_BLOCK = 512  # side of the blocks in written files [cells]


class _Part(NamedTuple):
    path: str
    place: Window
    """Map rows and columns that the raster covers."""
    stamp: tuple[int, int] | None
    """Modification time [ns] and size [bytes] of the file; None for virtual files."""
    transform: Any
    """`Affine` transform of the projected cells; None if the raster is not projected."""
    overview: int | None = None
    """Number of the overview to read; None for the raster itself."""


@dataclass(frozen=True, eq=False)
class RasterSource:
    """Source that reads layers from the bands of rasters that share a grid.

    If rasters overlap, a cell gets the first value that is not NaN. Rasters are reprojected to
    `crs` unless it is empty.
    """

    parts: tuple[_Part, ...]
    layers: tuple[str, ...]
    crs: str

    def describe(self) -> str:
        return f"{[*self.parts]} in {self.crs}"

    def prepare(self) -> None:
        """Do nothing, because windows share no data."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        layers = [np.full(shape(window), np.nan, np.float32, order="F") for _ in names]
        bands = [self.layers.index(name) + 1 for name in names]
        done: list[Window] = []
        starts, stops = self._places
        begin, end = ([side.start for side in window], [side.stop for side in window])
        for number in np.flatnonzero(((starts < end) & (stops > begin)).all(axis=1)):
            part = self.parts[number]
            place = common(part.place, window)
            images = [to_north_up(layer[within(place, window)]) for layer in layers]
            if any(min(shape(common(place, other))) > 0 for other in done):
                below = [np.empty_like(image) for image in images]
                self._read_part(part, place, bands, below)
                for image, values in zip(images, below, strict=True):
                    np.copyto(image, values, where=np.isnan(image))
            else:
                self._read_part(part, place, bands, images)
            done.append(place)
        return layers

    def _read_part(
        self, part: _Part, place: Window, bands: Sequence[int], images: Sequence[Layer]
    ) -> None:
        """Read a window of map rows and columns from a raster into `images`, one per band."""
        rows, columns = within(place, part.place)
        width = shape(part.place)[0]
        pixels = columns, slice(width - rows.stop, width - rows.start)
        with storage_errors(Path(part.path), "read"), gdal(part.path):
            raster = _opened(part, self.crs)
            if part.transform is None:
                read_pixels(raster, bands, pixels, images)
                return
            for block in Tiles(raster.shape, (_BLOCK, _BLOCK)).touching(pixels):
                found = [np.empty(shape(block), np.float32) for _ in bands]
                read_pixels(raster, bands, block, found)
                cells = common(block, pixels)
                for image, values in zip(images, found, strict=True):
                    image[within(cells, pixels)] = values[within(cells, block)]

    @cached_property
    def _places(self) -> tuple[Any, Any]:
        """Starts (N, 2) and stops (N, 2) of the rows and columns of each raster."""
        places = np.array([[(side.start, side.stop) for side in p.place] for p in self.parts])
        return places[..., 0], places[..., 1]


def _stamp(path: str) -> tuple[int, int] | None:
    if not Path(path).exists():
        return None
    about = Path(path).stat()
    return about.st_mtime_ns, about.st_size


def _opened(part: _Part, crs: str) -> Any:
    if part.stamp is not None and _stamp(part.path) != part.stamp:
        raise GridMapError("the file has been replaced or removed; open it again")
    # GDAL datasets are not thread-safe, so each thread opens its own.
    size, owner = shape(part.place), (os.getpid(), threading.get_ident())
    return _open(part.path, part.stamp, part.overview, crs, part.transform, size, owner)


@lru_cache(maxsize=_MOST_OPEN)
def _open(
    path: str,
    stamp: object,  # noqa: ARG001
    overview: int | None,
    crs: str,
    transform: Any,
    size: Size,
    owner: object,  # noqa: ARG001
) -> Any:
    raster = open_raster(path, overview)
    if transform is None:
        return raster
    return _warped(raster, crs, transform=transform, width=size[0], height=size[1])


def _warped(raster: Any, crs: str, **cells: Any) -> Any:
    """Return a virtual raster that is reprojected to `crs` on read, with bilinear interpolation."""
    bilinear = import_module("rasterio.enums").Resampling.bilinear
    vrt = import_module("rasterio.vrt").WarpedVRT
    # In float32, large values would lose digits before an offset makes them small.
    options = _WARPING | ({"dtype": "float64"} if any(raster.offsets) else {})
    return vrt(raster, crs=crs, resampling=bilinear, **cells, **options)


def open_rasters(paths: Sequence[str | PathLike[str]], tile: Size, crs: str = "") -> TiledData:
    headers = []
    for path in paths:  # In Python 3.11, a comprehension would add a stack frame.
        headers.append(_read_header(os.fspath(path), crs))
    first = headers[0]
    step, corner = first.geometry.resolution, first.north_west
    boxes = []
    for header in headers:
        with storage_errors(Path(header.path), "read"):
            boxes.append(_box(header, first, exact=not crs))
    west, north = min(box[0] for box in boxes), min(box[1] for box in boxes)
    east, south = max(box[2] for box in boxes), max(box[3] for box in boxes)
    rows, columns = first.geometry.size
    # For a single raster, the offset is exactly 0.
    offset = 0.5 * np.array([west + east - rows, columns - north - south]) * step
    parts = []
    for header, box in zip(headers, boxes, strict=True):
        place = slice(east - box[2], east - box[0]), slice(box[1] - north, box[3] - north)
        left, top = corner[0] + box[0] * step, corner[1] - box[1] * step
        cells = import_module("affine").Affine(step, 0.0, left, 0.0, -step, top) if crs else None
        # Processes of a cluster may have another working directory.
        file = f"{Path(header.path).absolute()}" if header.stamp else header.path
        parts.append(_Part(file, place, header.stamp, cells))
    tiled_map = TiledData(
        RasterSource(tuple(parts), tuple(first.stored.layers), crs),
        GridGeometry.from_size(
            (east - west, south - north), step, first.geometry.position + offset
        ),
        tile,
        frame_id=first.stored.empty.frame_id,
        timestamp=first.stored.empty.timestamp,
        basic_layers=tuple(first.stored.basic_layers),
        crs=first.crs,
    )
    return tiled_map._in_frame_at(first.origin) if first.origin else tiled_map


def overview_of(tiled_map: "TiledMap", step: int) -> tuple["TiledMap", int]:
    """Return the coarsest overview with cells at most `step` cells wide, and their width.

    Without a suitable overview, the map itself and the width 1 are returned. Positions in the
    overview are accurate to half a cell.
    """
    source = tiled_map.source
    if not isinstance(source, RasterSource) or len(source.parts) > 1 or source.parts[0].transform:
        return tiled_map, 1
    part = source.parts[0]
    with storage_errors(Path(part.path), "read"), gdal(part.path):
        factors = _opened(part, "").overviews(1)
        fitting = [(factor, level) for level, factor in enumerate(factors) if factor <= step]
        if not fitting:
            return tiled_map, 1
        factor, level = max(fitting)
        coarse = part._replace(overview=level)
        columns, rows = _opened(coarse, "").shape
    place = slice(0, rows), slice(0, columns)
    source = replace(source, parts=(coarse._replace(place=place),))
    # An overview has the same extent as the raster, so its cells may not be exactly square.
    resolution = factor * tiled_map.resolution
    geometry = GridGeometry.from_size((rows, columns), resolution, tiled_map.position)
    return replace(tiled_map, source=source, geometry=geometry), factor


# --- headers --------------------------------------------------------------------------------------


class _Header(NamedTuple):
    """Header of a raster, after the requested projection."""

    path: str
    stored: StoredMap
    crs: str
    stamp: tuple[int, int] | None
    origin: tuple[float, float] | None = None
    """Coordinates of the origin of the map frame, in the reference system [m]."""

    @property
    def geometry(self) -> GridGeometry:
        return self.stored.empty.geometry

    @property
    def north_west(self) -> tuple[float, float]:
        """Corner with the smallest x and the largest y [m]."""
        x, y = (self.geometry.position + [-0.5, 0.5] * self.geometry.length).tolist()
        return x, y


def _read_header(path: str, crs: str) -> _Header:
    with storage_errors(Path(path), "read"), gdal(path), open_raster(path) as raster:
        stamp = _stamp(path)
        if not crs:
            _warn(raster, path)
            stored = stored_map(raster, path, geometry_of(raster, path))
            system = raster.crs.to_wkt() if raster.crs else ""
            return _Header(path, stored, system, stamp, origin_of(raster, path))
        if not raster.crs:
            raise ValueError(f"has no reference system from which {crs} could be reached")
        with _warped(raster, crs) as projected:
            if unit := unit_of(projected):
                raise ValueError(f"crs: expected a reference system in meters, got {unit}")
            stored = stored_map(raster, path, geometry_of(projected, path))
            return _Header(path, stored, projected.crs.to_wkt(), stamp)


def _warn(raster: Any, path: str) -> None:
    """Warn about coordinates that are not in meters, and about wide strips."""
    if unit := unit_of(raster):
        longitude, latitude = raster.lnglat()
        zone = min(max(int((longitude + 180.0) // 6.0), 0), 59) + 1
        code = f"EPSG:{(32600 if latitude >= 0 else 32700) + zone}"
        warnings.warn(
            f"{path}: is in {unit}, which are treated as meters; open_map(..., crs={code!r}) "
            "projects it into meters",
            stacklevel=5,
        )
    if raster.block_shapes[0][1] == raster.width > _WIDEST_STRIP and raster.compression:
        target = f"{Path(path).with_name(Path(path).stem)}_tiled.tif"
        words = ["gdal_translate", "-co", "TILED=YES", "-co", "BIGTIFF=IF_SAFER", path, target]
        warnings.warn(
            f"{path}: is stored in strips of {raster.width} pixels, so that windows are slow to "
            f"read; to fix this, run: {shlex.join(words)}",
            stacklevel=5,
        )


def _box(header: _Header, first: _Header, *, exact: bool) -> tuple[int, int, int, int]:
    """Return the sides of a raster in the grid of a mosaic: west, north, east, south [cells].

    The north-west corner of the first raster is (0, 0). Both rasters must have the same layers and
    reference system. With `exact`, they must also lie on the same grid. Otherwise, the sides are
    rounded outwards.
    """
    of_crs = import_module("rasterio.crs").CRS.from_user_input
    if header.crs != first.crs and (
        not header.crs or not first.crs or of_crs(header.crs) != of_crs(first.crs)
    ):
        names = [of_crs(text).to_string() if text else "none" for text in (first.crs, header.crs)]
        expected = f"the reference system of {first.path}, {names[0]}"
        raise ValueError(f"expected {expected}, got {names[1]}")
    if header.stored.layers != first.stored.layers:
        names = [", ".join(one.stored.layers) for one in (first, header)]
        raise ValueError(f"expected the layers of {first.path}, {names[0]}, got {names[1]}")
    own, step = header.geometry.resolution, first.geometry.resolution
    west, north = (
        sign * (mine - other) / step
        for sign, mine, other in zip((1, -1), header.north_west, first.north_west, strict=True)
    )
    width, height = header.geometry.size
    if not exact:
        east, south = west + width * own / step, north + height * own / step
        # Corner coordinates have rounding errors, even those of the first raster.
        lower, upper = math.floor(west + 1e-6), math.floor(north + 1e-6)
        return lower, upper, math.ceil(east - 1e-6), math.ceil(south - 1e-6)
    if abs(own - step) > _LARGEST_DIFFERENCE * step:
        raise ValueError(f"expected the pixels of {first.path}, {step:.12g}, got {own:.12g}")
    left, top = round(west), round(north)
    if max(abs(west - left), abs(north - top)) > _LARGEST_SHIFT:
        raise ValueError(
            f"expected pixels on the grid of {first.path}, got ones that are shifted by "
            f"({west - left:.3g}, {top - north:.3g}) pixels"
        )
    return left, top, left + width, top + height


# --- writing --------------------------------------------------------------------------------------


def to_geotiff(
    tiled_map: TiledData,
    path: str | PathLike[str],
    names: Sequence[str],
    progress: Progress,
    *,
    cog: bool,
    compress: bool,
    overwrite: bool,
) -> None:
    target = Path(path)
    check_ending(target, ".tif", ".tiff")
    # With PAM, GDAL would leave auxiliary files in the folder.
    with gdal(target, GDAL_PAM_ENABLED=False), storage_errors(target, "written"):
        if not names:
            raise GridMapError("the map has no layers")
        if target.exists() and not overwrite:
            raise GridMapError("already exists; 'overwrite' replaces it")
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
    progress: Progress,
    *,
    compress: bool,
) -> None:
    profile = raster_profile(tiled_map, len(names), compress=compress)
    profile |= {
        "tiled": True,
        "blockxsize": _FILE_BLOCK,
        "blockysize": _FILE_BLOCK,
        "interleave": "band",
    }
    # Windows consist of whole blocks, so that each block is compressed only once.
    width, height = (-(-side // _FILE_BLOCK) * _FILE_BLOCK for side in tiled_map.tile)
    windows = Tiles((tiled_map.size[1], tiled_map.size[0]), (height, width))
    rectangle = import_module("rasterio.windows").Window.from_slices
    with import_module("rasterio").open(file, "w", **profile) as raster:
        describe_raster(raster, tiled_map, names)
        progress(0, len(windows))
        parts = in_any_order(partial(_compute, tiled_map, names), windows)
        for done, (window, layers) in enumerate(parts, 1):
            raster.write(np.stack([*map(to_north_up, layers)]), window=rectangle(*window))
            progress(done, len(windows))


def _compute(tiled_map: TiledData, names: Sequence[str], window: Window) -> list[Layer]:
    """Compute the layers of a map in a window of raster lines and pixels."""
    lines, pixels = window
    rows = slice(tiled_map.size[0] - pixels.stop, tiled_map.size[0] - pixels.start)
    return tiled_map.source.read((rows, lines), names)


def _copy_as_cog(tiles: Path, file: Path, *, compress: bool) -> None:
    """Build the overviews of the file `tiles`, and copy it to `file` in the COG layout."""
    with import_module("rasterio").open(tiles, "r+") as raster:
        levels = range(1, max(0, (max(raster.shape) - 1) // _FILE_BLOCK).bit_length() + 1)
        # "nearest" would use only one of four heights.
        average = import_module("rasterio.enums").Resampling.average
        raster.build_overviews([2**level for level in levels], average)
    packing = {"COMPRESS": "DEFLATE", "PREDICTOR": "YES"} if compress else {"COMPRESS": "NONE"}
    import_module("rasterio.shutil").copy(
        tiles,
        file,
        driver="COG",
        BLOCKSIZE=_FILE_BLOCK,
        BIGTIFF="IF_SAFER",
        NUM_THREADS="ALL_CPUS",
        **packing,
    )


def _check_complete(file: Path) -> None:
    """Raise `OSError` if a block is missing, because GDAL may not report a full disk."""
    length, last = file.stat().st_size, (-1, 0, 0, 0)
    with import_module("rasterio").open(file) as raster:
        levels = [(None, 1), *enumerate(raster.overviews(1))]
        for band, (level, factor) in itertools.product(raster.indexes, levels):
            counts = (-(-side // (factor * _FILE_BLOCK)) for side in raster.shape)
            for row, column in np.ndindex(*counts):
                offset, size = (
                    raster.get_tag_item(f"BLOCK_{kind}_{column}_{row}", "TIFF", band, level)
                    for kind in ("OFFSET", "SIZE")
                )
                if offset is None or int(offset) + int(size) > length:
                    raise OSError("a block is missing, perhaps because the disk is full")
                if level is None:
                    last = max(last, (int(offset), band, row, column))
        # GDAL 3.6 records the offset of a block even if writing failed, but cannot read the block.
        _, band, row, column = last
        raster.read(
            band, window=tuple((n * _FILE_BLOCK, n * _FILE_BLOCK + 1) for n in (row, column))
        )
