# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files as sources of tiled maps: one raster, or a mosaic of rasters on one grid."""

import math
import os
import shlex
import threading
import warnings
from collections import OrderedDict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .._arrays._checks import Layer, Size
from ..files._geotiff import (
    block_bytes,
    check_crs,
    geometry_of,
    open_raster,
    origin_of,
    read_pixels,
    scale_pixels,
    stored_map,
    unit_of,
)
from ..files._image_files import to_north_up
from ..files._shared import StoredMap, storage_errors
from ..limits import check_bytes
from ..map._geometry import GridGeometry
from ._earth import moved_map
from ._source import TiledData, Tiles, Window, common, shape, within

if TYPE_CHECKING:
    from ._tiled_map import TiledMap

_LARGEST_SHIFT = 1e-3
"""Largest distance between the cells of a raster and the grid of its mosaic [cells]."""

_LARGEST_DIFFERENCE = 1e-6
"""Largest relative difference between the sides of pixels of a mosaic."""

_MOST_OPEN = 16
"""Rasters that a thread keeps open."""

_WIDEST_STRIP = 8192
"""Pixels of a packed strip; of wider ones, a window unpacks many times its own size."""

_CACHE = 2**27
"""Unpacked blocks that GDAL keeps in a process that reads windows [bytes]."""

_WARPING: dict[str, Any] = {
    "dtype": "float32",
    "nodata": math.nan,
    "tolerance": 0.01,
    # By default the filter depends on the window.
    "XSCALE": 1,
    "YSCALE": 1,
    # By default a band keeps the value of no data where another band has a value.
    "UNIFIED_SRC_NODATA": "NO",
}
"""Options of GDAL for projected rasters; the tolerance of positions is in pixels."""

_BLOCK = 256
"""Side of the blocks in which a raster is projected [cells].

GDAL interpolates positions within a window. In fixed blocks a cell has one value, whatever is read.
"""


class _Grid(NamedTuple):
    """Cells onto which a raster is projected: borders at west and north, and side of a cell."""

    west: float
    north: float
    step: float


class _Part(NamedTuple):
    """A raster of a mosaic."""

    path: str
    place: Window
    """Rows and columns of the map that it covers."""
    stamp: tuple[int, int]
    """Time of change [ns] and length [bytes] of the file."""
    grid: _Grid | None
    """None if the raster is read as it is."""
    overview: int | None = None
    """Number of the overview that is read in its place."""


@dataclass(frozen=True, eq=False)
class RasterSource:
    """Layers in the bands of rasters on one grid. Where rasters overlap, the first value wins.

    Args:
        parts: the rasters.
        layers: names of the bands.
        crs: reference system into which the rasters are projected; empty to read them as they are.
        virtual: whether paths may be those of virtual files of GDAL.
    """

    parts: tuple[_Part, ...]
    layers: tuple[str, ...]
    crs: str
    virtual: bool

    def __getstate__(self) -> dict[str, Any]:
        # Processes of a cluster may have another working directory.
        path = str if self.virtual else os.path.abspath
        parts = tuple(part._replace(path=path(part.path)) for part in self.parts)
        return {**self.__dict__, "parts": parts}

    def describe(self) -> str:
        files = [(f"{Path(part.path).absolute()}", *part[1:]) for part in self.parts]
        return f"{files} in {self.crs}"

    def prepare(self) -> None:
        """Do nothing: windows have nothing in common."""

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        layers = [np.empty(shape(window), np.float32, order="F") for _ in names]
        bands = [self.layers.index(name) + 1 for name in names]
        done: list[Window] = []
        for part in self._touched(window):
            place = common(part.place, window)
            if not done and place != window:
                _clear(layers)
            images = [to_north_up(layer[within(place, window)]) for layer in layers]
            if any(_overlap(place, other) for other in done):
                below = [np.empty_like(image) for image in images]
                self._read_part(part, place, bands, below)
                for image, values in zip(images, below, strict=True):
                    np.copyto(image, values, where=np.isnan(image))
            else:
                self._read_part(part, place, bands, images)
            done.append(place)
        if not done:
            _clear(layers)
        return layers

    def _read_part(
        self, part: _Part, place: Window, bands: Sequence[int], images: Sequence[Layer]
    ) -> None:
        """Read the cells at a place of the map, which a raster covers, into images."""
        rows, columns = within(place, part.place)
        width = shape(part.place)[0]
        pixels = columns, slice(width - rows.stop, width - rows.start)
        # Without an environment of rasterio, GDAL prints its errors.
        env = import_module("rasterio").Env()
        with storage_errors(Path(part.path), "read"), env:
            raster = _open(part, self)
            if part.grid is None:
                _check_blocks(raster, pixels, part)
                read_pixels(raster, bands, pixels, images)
            else:
                _project(raster, bands, pixels, images)

    def _touched(self, window: Window) -> Iterator[_Part]:
        """Return the rasters that have cells of a window."""
        starts, stops = self._places
        begin, end = ([side.start for side in window], [side.stop for side in window])
        touched = ((starts < end) & (stops > begin)).all(axis=1)
        return (self.parts[number] for number in np.flatnonzero(touched))

    @cached_property
    def _places(self) -> tuple[Any, Any]:
        """First cells of the rasters, and those behind their last ones, each (N, 2)."""
        places = np.array([[(side.start, side.stop) for side in p.place] for p in self.parts])
        return places[..., 0], places[..., 1]


def open_rasters(
    paths: Sequence[str | PathLike[str]], tile: Size, crs: str = "", *, virtual: bool = False
) -> TiledData:
    """Return the tiled map of one raster, or of several on one grid; see `open_map`."""
    check_crs(crs)
    headers = []
    for path in paths:  # A comprehension is a level of the stack in Python 3.11.
        headers.append(_read_header(os.fspath(path), crs, virtual=virtual))
    first = headers[0]
    step, corner = first.geometry.resolution, first.north_west
    boxes = []
    for header in headers:
        with storage_errors(Path(header.path), "read"):
            _check_like_first(header, first)
            boxes.append(_box(header, first, exact=not crs))
    west, north = min(box[0] for box in boxes), min(box[1] for box in boxes)
    east, south = max(box[2] for box in boxes), max(box[3] for box in boxes)
    rows, columns = first.geometry.size
    # Exactly that of the raster, if there is one.
    offset = 0.5 * np.array([west + east - rows, columns - north - south]) * step
    parts = []
    for header, box in zip(headers, boxes, strict=True):
        place = slice(east - box[2], east - box[0]), slice(box[1] - north, box[3] - north)
        grid = _Grid(corner[0] + box[0] * step, corner[1] - box[1] * step, step) if crs else None
        parts.append(_Part(header.path, place, header.stamp, grid))
    size = east - west, south - north
    site = TiledData(
        RasterSource(tuple(parts), tuple(first.stored.layers), crs, virtual),
        GridGeometry.from_size(size, step, first.geometry.position + offset),
        tile,
        frame_id=first.stored.empty.frame_id,
        timestamp=first.stored.empty.timestamp,
        basic_layers=tuple(first.stored.basic_layers),
        crs=first.crs,
    )
    return moved_map(site, first.origin) if first.origin else site


def overview_of(site: "TiledMap", step: int) -> tuple["TiledMap", int]:
    """Return the smallest overview of a raster whose cells are at most `step` times as large.

    Returns:
        overview: its map, whose cells are in their places within half a cell; `site` itself if
            that is no single raster, is projected, or has no such overview.
        factor: side of its cells [cells of `site`].
    """
    source = site.source
    if not isinstance(source, RasterSource) or len(source.parts) > 1 or source.parts[0].grid:
        return site, 1
    part = source.parts[0]
    with storage_errors(Path(part.path), "read"):
        factors = _open(part, source).overviews(1)
        fitting = [(factor, level) for level, factor in enumerate(factors) if factor <= step]
        if not fitting:
            return site, 1
        factor, level = max(fitting)
        coarse = part._replace(overview=level)
        columns, rows = _open(coarse, source).shape
    place = slice(0, rows), slice(0, columns)
    source = replace(source, parts=(coarse._replace(place=place),))
    # GDAL takes an overview for the whole raster: its cells are not quite square.
    resolution = factor * site.resolution
    geometry = GridGeometry.from_size((rows, columns), resolution, site.position)
    return replace(site, source=source, geometry=geometry), factor


# --- headers --------------------------------------------------------------------------------------


class _Header(NamedTuple):
    """Description of a raster, which may be projected."""

    path: str
    stored: StoredMap
    crs: str
    stamp: tuple[int, int]
    origin: tuple[float, float] | None = None
    """Where the frame of the map has its origin."""

    @property
    def geometry(self) -> GridGeometry:
        return self.stored.empty.geometry

    @property
    def north_west(self) -> tuple[float, float]:
        """The corner with the smallest x and the largest y [m]."""
        x, y = (self.geometry.position + [-0.5, 0.5] * self.geometry.length).tolist()
        return x, y


def _read_header(path: str, crs: str, *, virtual: bool) -> _Header:
    with (
        storage_errors(Path(path), "read"),
        open_raster(path, virtual=virtual, whole=False) as raster,
    ):
        stamp = _stamp(path, virtual=virtual)
        if not crs:
            _warn(raster, path)
            stored = stored_map(raster, path, geometry_of(raster, path), stamp[1])
            system = raster.crs.to_wkt() if raster.crs else ""
            return _Header(path, stored, system, stamp, origin_of(raster, path))
        if not raster.crs:
            raise ValueError(f"has no reference system from which {crs} could be reached")
        with _warped(raster, crs) as projected:
            if unit := unit_of(projected):
                raise ValueError(f"crs: expected a reference system in meters, got {unit}")
            stored = stored_map(raster, path, geometry_of(projected, path), stamp[1])
            return _Header(path, stored, projected.crs.to_wkt(), stamp)


def _stamp(path: str, *, virtual: bool) -> tuple[int, int]:
    if virtual:
        return 0, 2**63
    about = Path(path).stat()
    return about.st_mtime_ns, about.st_size


def _warn(raster: Any, path: str) -> None:
    """Warn if the coordinates are not meters, or if windows are slow to read."""
    if unit := unit_of(raster):
        longitude, latitude = raster.lnglat()
        zone = min(max(int((longitude + 180.0) // 6.0), 0), 59) + 1
        code = f"EPSG:{(32600 if latitude >= 0 else 32700) + zone}"
        warnings.warn(
            f"{path}: is in {unit}, which are taken for meters; open_map(..., crs={code!r}) "
            "projects it into meters",
            stacklevel=5,
        )
    if raster.block_shapes[0][1] == raster.width > _WIDEST_STRIP and raster.compression:
        target = f"{Path(path).with_name(Path(path).stem)}_tiled.tif"
        line = shlex.join(
            ["gdal_translate", "-co", "TILED=YES", "-co", "BIGTIFF=IF_SAFER", path, target]
        )
        warnings.warn(
            f"{path}: is stored in strips of {raster.width} pixels, so that windows are slow to "
            f"read; to mend it: {line}",
            stacklevel=5,
        )


def _check_like_first(header: _Header, first: _Header) -> None:
    """Raise `ValueError` if a raster differs from the first one of a mosaic."""
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


def _box(header: _Header, first: _Header, *, exact: bool) -> tuple[int, int, int, int]:
    """Return the sides of a raster (west, north, east, south), in cells from the first corner.

    Args:
        header, first: the raster and the first one of the mosaic.
        exact: whether it must lie on the grid; otherwise cells that it touches are counted.
    """
    own, step = header.geometry.resolution, first.geometry.resolution
    west, north = (
        sign * (mine - other) / step
        for sign, mine, other in zip((1, -1), header.north_west, first.north_west, strict=True)
    )
    width, height = header.geometry.size
    if not exact:
        east, south = west + width * own / step, north + height * own / step
        # The corner of the first raster itself has rounding errors.
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


# --- open rasters ---------------------------------------------------------------------------------


class _Rasters(threading.local):
    """The rasters that a thread has open."""

    def __init__(self) -> None:
        self.process = os.getpid()
        self.by_key: OrderedDict[Any, Any] = OrderedDict()


_rasters = _Rasters()
_inherited: list[Any] = []
"""Rasters of the process before a fork, which shares its files: not to be read, nor closed."""

_bounded: set[int] = set()
"""This process, if it has bounded the cache of GDAL."""


def _open(part: _Part, source: RasterSource) -> Any:
    """Return the open raster of a part: this thread's own, because GDAL does not share them."""
    if _rasters.process != os.getpid():
        _inherited.append(_rasters.by_key)
        _rasters.__init__()  # type: ignore[misc]
    key = part.path, part.stamp, part.grid, shape(part.place), source.crs, part.overview
    rasters = _rasters.by_key
    if _stamp(part.path, virtual=source.virtual) != part.stamp:
        raise ValueError("has changed since the map was opened")
    if key not in rasters:
        bound_cache()
        raster = open_raster(part.path, virtual=source.virtual, whole=False, overview=part.overview)
        rasters[key] = _warped(raster, source.crs, part) if part.grid else raster
        while len(rasters) > _MOST_OPEN:
            _close(rasters.popitem(last=False)[1])
    rasters.move_to_end(key)
    return rasters[key]


def _close(raster: Any) -> None:
    raster.close()
    if source := getattr(raster, "src_dataset", None):
        source.close()


def _warped(raster: Any, crs: str, part: _Part | None = None) -> Any:
    """Return a raster that is projected when it is read, by bilinear interpolation.

    Args:
        raster: the raster as it is.
        crs: reference system.
        part: tells the cells; None leaves them to GDAL.
    """
    vrt, resampling = import_module("rasterio.vrt"), import_module("rasterio.enums").Resampling
    cells: dict[str, Any] = {}
    if part is not None and part.grid is not None:
        width, height = shape(part.place)
        west, north, step = part.grid
        transform = import_module("affine").Affine(step, 0.0, west, 0.0, -step, north)
        cells = {"transform": transform, "width": width, "height": height}
    return vrt.WarpedVRT(raster, crs=crs, resampling=resampling.bilinear, **cells, **_WARPING)


def _project(raster: Any, bands: Sequence[int], pixels: Window, images: Sequence[Layer]) -> None:
    """Read a window of a projected raster; arguments: see `read_pixels`."""
    rectangle = import_module("rasterio.windows").Window
    for block in Tiles(raster.shape, (_BLOCK, _BLOCK)).touching(pixels):
        # Single bands would project all of them each time.
        values = raster.read([*bands], window=rectangle.from_slices(*block))
        part = common(block, pixels)
        for band, image, found in zip(bands, images, values, strict=True):
            scale_pixels(raster, band, found)
            image[within(part, pixels)] = found[within(part, block)]


def bound_cache() -> None:
    """Let GDAL keep few blocks, unless the program or its user has said how many.

    By default these are 5 % of the memory of the machine, for each process.
    """
    env = import_module("rasterio.env")
    chosen = {**os.environ, **(env.getenv() if env.hasenv() else {})}
    if os.getpid() not in _bounded and "GDAL_CACHEMAX" not in chosen:
        import_module("rasterio._env").set_gdal_config("GDAL_CACHEMAX", _CACHE)
    _bounded.add(os.getpid())


def _check_blocks(raster: Any, pixels: Window, part: _Part) -> None:
    """Raise `LimitError` if the blocks of a window would unpack to too many bytes."""
    blocks = math.prod(
        -(-side.stop // step) - side.start // step
        for side, step in zip(pixels, raster.block_shapes[0], strict=True)
    )
    check_bytes(f"{part.path}: blocks of a window", blocks * block_bytes(raster), part.stamp[1])


# --- windows --------------------------------------------------------------------------------------


def _overlap(one: Window, other: Window) -> bool:
    return min(shape(common(one, other))) > 0


def _clear(layers: Iterable[Layer]) -> None:
    for layer in layers:
        layer.fill(np.nan)
