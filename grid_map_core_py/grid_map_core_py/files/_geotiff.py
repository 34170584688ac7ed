# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files: one band of float32 per layer, described by its name; NaN is no data.

Rows of a raster run to -y and columns to +x. A tag holds the frame, the time and the basic layers
of the map. The position comes from the raster, so a raster that was cropped elsewhere is right.
"""

import json
import math
import os
import re
import shlex
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays._checks import Layer
from ..errors import GridMapError, LimitError
from ..limits import check_bytes
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..plugins import check
from ._atomic import new_file
from ._image_files import to_north_up
from ._shared import StoredMap, check_ending, package_for, storage_errors
from ._tiff import HEADS, check_tiff, check_tiles

_TAG = "GRID_MAP"

_CRS = re.compile(
    r"(EPSG|ESRI|IAU_\d{4}|IGNF|OGC):[\w+]+"  # a code
    r"|\s*[A-Z]\w*\s*\[.*"  # WKT
    r"|\s*\+(?!.*\binit\b)[^/]*",  # a string of PROJ, without files
    re.IGNORECASE | re.DOTALL,
)
"""Reference systems that GDAL knows by itself: it takes others for files and addresses."""

_LARGEST_DIFFERENCE = 1e-6
"""Largest relative difference between the sides of a pixel."""

_LARGEST_BESIDE = 2**24
"""Maximum size of a file of metadata beside a raster [bytes]."""

_LARGEST_WORLD = 1000
"""Characters of a world file that are read; it has six numbers."""

_WINDOW = 2**24
"""Bytes that are read at once; the cache of GDAL holds more."""


def save_geotiff(
    grid_map: GridMap, path: str | PathLike[str], *, crs: str = "", compress: bool = False
) -> None:
    """Write a map to a GeoTIFF file.

    The file is written atomically; an existing one is replaced. Memory for the whole file is taken.

    Args:
        grid_map: the map; a moved one is stored in map order.
        path: the file.
        crs: coordinate reference system of the frame: a code such as "EPSG:25832", WKT, or a string
            of PROJ that names no file; empty for none.
        compress: make the file smaller.

    Raises:
        ConfigError: `crs` is of another form.
        GridMapError: the map has no layers, the file cannot be written or its name ends like
            another kind of file, the reference system is unknown, or rasterio is not installed.
    """
    check_ending(path, ".tif", ".tiff")
    rasterio = package_for(path, "GeoTIFF", "rasterio")
    if not grid_map.layers:
        raise GridMapError(f"{path}: cannot be written: the map has no layers")
    check_crs(crs)
    profile = raster_profile(grid_map.geometry, len(grid_map.layers), crs, compress=compress)
    tags = raster_tags(grid_map.frame_id, grid_map.timestamp, grid_map.basic_layers)
    # GDAL reports no error if the disk or the memory is full while it closes a file. Therefore
    # Python writes the bytes, after a check that GDAL reads the same from them.
    with storage_errors(Path(path), "written"), rasterio.MemoryFile() as memory:
        with memory.open(**profile) as raster:
            raster.update_tags(**tags)
            for band, name in enumerate(grid_map, 1):
                raster.write(to_north_up(grid_map.unwrapped(name)), band)
                raster.set_band_description(band, name)
        with memory.open() as raster:
            for band, name in enumerate(grid_map, 1):
                bits = to_north_up(grid_map.unwrapped(name)).view(np.uint32)
                if not np.array_equal(raster.read(band).view(np.uint32), bits):
                    raise MemoryError("GDAL could not hold the whole file in memory")
        with new_file(path) as temporary:
            temporary.write_bytes(memory.getbuffer())


def check_crs(crs: str) -> None:
    """Raise `ConfigError` for a reference system that GDAL would take for a file or an address."""
    expected = "a code such as 'EPSG:25832', WKT or a string of PROJ without files"
    check(not crs or bool(_CRS.fullmatch(crs)), "crs", expected, crs)


def raster_profile(
    geometry: GridGeometry, layers: int, crs: str, *, compress: bool
) -> dict[str, Any]:
    """Return the options of rasterio for a raster of layers, with north up."""
    west, north = (geometry.position + [-0.5, 0.5] * geometry.length).tolist()
    step = geometry.resolution
    profile = {
        "driver": "GTiff",
        "width": geometry.size[0],
        "height": geometry.size[1],
        "count": layers,
        "dtype": "float32",
        "nodata": np.nan,
        "transform": import_module("affine").Affine(step, 0.0, west, 0.0, -step, north),
        "crs": crs or None,
        # A classic TIFF holds at most 4 GB.
        "BIGTIFF": "IF_SAFER",
    }
    # Differences of floats between neighbors are small; the predictor for floats is 3.
    return profile | ({"compress": "deflate", "predictor": 3} if compress else {})


def raster_tags(
    frame_id: str, timestamp: int, basic_layers: Sequence[str], **facts: Any
) -> dict[str, str]:
    """Return the tags of a raster that hold what only a map has.

    Args:
        frame_id, timestamp, basic_layers: see `GridMap`.
        facts: `origin`, where the origin of the frame is in the reference system [m], and `crs`,
            that system; without them the frame has its coordinates.
    """
    facts |= {"frame_id": frame_id, "timestamp": timestamp, "basic_layers": [*basic_layers]}
    return {_TAG: json.dumps(facts)}


def load_geotiff(
    path: str | PathLike[str], layers: Iterable[str] | None = None, *, virtual: bool = False
) -> GridMap:
    """Return the map in a GeoTIFF file of this or another program.

    A single band without a name becomes `elevation`, several become `band_1` and so on. Masked
    pixels are NaN. Scales and offsets of bands are applied. A warning tells if the coordinates are
    not meters.

    Args:
        path: the file.
        layers: names of the layers to read; None means all.
        virtual: let the path name a virtual file of GDAL, such as `/vsicurl/https://...`.

    Raises:
        GridMapError: the file is damaged or no GeoTIFF, its pixels are no squares along the axes,
            it lacks a layer, a file beside it holds a mask, or rasterio is not installed.
    """
    with opened(path, virtual=virtual) as (raster, stored):
        _warn_of_unit(raster, path)
        return stored.load(layers)


def describe_geotiff(path: str | PathLike[str], *, virtual: bool = False) -> dict[str, Any]:
    """Return what the file tells about its map; errors are those of `load_geotiff`."""
    with opened(path, virtual=virtual, whole=False) as (raster, stored):
        _warn_of_unit(raster, path)
        facts: dict[str, Any] = {"crs": raster.crs.to_string()} if raster.crs else {}
        if origin := origin_of(raster, path):
            facts["origin"] = [*origin]
        return {"map": facts | stored.facts()}


def open_raster(
    path: str | PathLike[str],
    *,
    virtual: bool = False,
    whole: bool = True,
    overview: int | None = None,
) -> Any:
    """Return the open dataset of rasterio for a GeoTIFF file; no other file is opened.

    Rasters of other formats (VRT), auxiliary files beside the raster and some metadata can name
    any file and any address. Therefore GDAL may use its driver for GeoTIFF only, reads no file
    beside the raster, and takes the path for that of a file.

    Args:
        path: the file.
        virtual: let the path name a virtual file of GDAL.
        whole: False if only windows of the raster will be read, so that it may have any size.
        overview: number of the overview that is opened instead of the raster; 0 is the largest.

    Raises:
        MissingPackageError: rasterio is not installed.
        LimitError: the raster, or a block of it, is too large.
        OSError, ValueError: the file is damaged, no GeoTIFF, or other files belong to its values.
    """
    rasterio = package_for(path, "GeoTIFF", "rasterio")
    name = str(path if virtual else Path(path).absolute())
    if name.startswith("/vsi") and not virtual:
        raise ValueError("expected the path of a file; 'virtual=True' takes those of GDAL")
    packed = math.inf if virtual else _checked_length(Path(name), whole=whole)
    _check_beside(Path(f"{name}.msk"), b"")
    _check_beside(Path(f"{name}.aux.xml"), rb"<(NoDataValue|Offset|Scale)\b")
    alone = rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR", GDAL_PAM_ENABLED=False)
    level = {} if overview is None else {"overview_level": overview}
    with alone:
        raster = rasterio.open(name, driver="GTiff", **level)
    if "OVERVIEW_FILE" in raster.tags(ns="OVERVIEWS"):
        raster.close()
        raise ValueError("expected overviews in the same file")
    try:
        _check_block(raster, f"{path}", packed, whole=whole)
    except LimitError:
        raster.close()
        raise
    return raster


def _check_block(raster: Any, name: str, packed: float, *, whole: bool) -> None:
    """Raise `LimitError` if GDAL would unpack too much at once."""
    check_tiles(name, raster.shape, raster.block_shapes[0], whole=whole)
    check_bytes(f"{name}: block", block_bytes(raster), packed)


def _checked_length(file: Path, *, whole: bool = True) -> int:
    """Return the length of a file [bytes] after a check of the tiles that it claims."""
    with file.open("rb") as stream:
        length = os.fstat(stream.fileno()).st_size
        if stream.read(4) in HEADS:
            check_tiff(f"{file}", stream, whole=whole)
    return length


def _check_beside(file: Path, pattern: bytes) -> None:
    """Refuse a file beside a raster whose content would change the values of the raster."""
    if not file.is_file():
        return
    with file.open("rb") as stream:
        text = stream.read(_LARGEST_BESIDE + 1)
    if re.search(pattern, text):
        raise ValueError(
            f"has a mask, a scale or the value of no data in {file.name}; 'gdal_translate "
            "--config GDAL_TIFF_INTERNAL_MASK YES' makes one file of both"
        )
    if len(text) > _LARGEST_BESIDE:
        raise ValueError(f"expected at most {_LARGEST_BESIDE} bytes in {file.name}")


@contextmanager
def opened(
    path: str | PathLike[str], *, virtual: bool, whole: bool = True
) -> Iterator[tuple[Any, StoredMap]]:
    """Open a raster; yield it and its map. Arguments: see `open_raster`."""
    with (
        storage_errors(Path(path), "read"),
        open_raster(path, virtual=virtual, whole=whole) as raster,
    ):
        packed = math.inf if virtual else Path(path).stat().st_size
        geometry = geometry_of(raster, path)
        if origin := origin_of(raster, path):
            geometry = geometry.at(geometry.position - origin)
        yield raster, stored_map(raster, path, geometry, packed)


def stored_map(
    raster: Any, path: str | PathLike[str], geometry: GridGeometry, packed: float
) -> StoredMap:
    """Return the map in an open raster.

    Args:
        raster: the open dataset.
        path: its file.
        geometry: the cells.
        packed: bytes in the file.
    """
    tags = _tags_of(raster)
    frame_id, timestamp = str(tags.get("frame_id", "map")), int(tags.get("timestamp", 0))
    empty = GridMap.from_geometry(geometry, frame_id=frame_id, timestamp=timestamp)
    names = names_of(raster.descriptions)
    bands = {name: band for band, name in enumerate(names, 1)}
    basic = [name for name in tags.get("basic_layers", ()) if name in bands]
    return StoredMap(empty, names, basic, partial(_read_bands, raster, bands), Path(path), packed)


def origin_of(raster: Any, path: str | PathLike[str]) -> tuple[float, float] | None:
    """Return where the frame of the map has its origin in the reference system [m].

    None stands for a frame with the coordinates of the system.
    """
    tags = _tags_of(raster)
    if "origin" not in tags:
        return None
    x, y = map(float, tags["origin"])
    system = str(tags.get("crs", ""))
    check_crs(system)
    if not math.isfinite(x + y):
        raise ValueError(f"its tag {_TAG} is damaged")
    if (raster.crs or "") != import_module("rasterio.crs").CRS.from_user_input(system):
        warnings.warn(
            f"{path}: has been projected; the frame of its map has another origin now", stacklevel=5
        )
        return None
    return x, y


def _tags_of(raster: Any) -> dict[str, Any]:
    tags = json.loads(raster.tags().get(_TAG, "{}"))
    if not isinstance(tags, dict):
        raise ValueError(f"its tag {_TAG} is damaged")
    return tags


def unit_of(raster: Any) -> str:
    """Return the unit of the coordinates of a raster; empty for meters and if it is unknown."""
    if raster.crs and raster.crs.is_geographic:
        return "degrees"
    if raster.crs and raster.crs.is_projected:
        name, meters = raster.crs.linear_units_factor
        return "" if meters == 1.0 else f"units of {meters:.7g} m ({name})"
    return ""


def _warn_of_unit(raster: Any, path: str | PathLike[str]) -> None:
    """Warn if the coordinates are not meters."""
    if unit := unit_of(raster):
        warnings.warn(
            f"{path}: is in {unit}, which are taken for meters; "
            "'gdalwarp -t_srs EPSG:...' projects it",
            stacklevel=4,
        )


def geometry_of(raster: Any, path: str | PathLike[str]) -> GridGeometry:
    """Return the geometry of an open raster.

    Raises:
        ValueError: the pixels are no squares with north up, or the raster does not say where it is.
    """
    step = raster.transform
    worlds = (Path(path).with_suffix(ending) for ending in (".tfw", ".tifw", ".wld"))
    if step.is_identity and (world := next(filter(Path.is_file, worlds), None)):
        with world.open() as stream:
            step = import_module("affine").loadsw(stream.read(_LARGEST_WORLD))
    if step.is_identity:
        raise ValueError(
            "does not say where it lies (no geotransform); 'resolution' reads it as a height image"
        )
    square = abs(step.a + step.e) <= _LARGEST_DIFFERENCE * abs(step.a)
    if step.b or step.d or not step.a > 0 or not square:
        raise ValueError(
            "expected square pixels with north up, got "
            f"{step.a:g} x {-step.e:g} turned by ({step.b:g}, {step.d:g}); "
            f"to mend it: {_gdalwarp(path, step)}"
        )
    size = raster.width, raster.height
    corner = np.array([step.c, step.f])
    position = corner + np.array([0.5, -0.5]) * size * step.a
    return GridGeometry.from_size(size, step.a, position)


def _gdalwarp(path: str | PathLike[str], step: Any) -> str:
    """Return the line of a shell that makes square pixels with north up."""
    side = f"{math.sqrt(abs(step.determinant)):.12g}"
    target = Path(path).with_name(f"{Path(path).stem}_north_up.tif")
    return shlex.join(["gdalwarp", "-r", "bilinear", "-tr", side, side, f"{path}", f"{target}"])


def names_of(descriptions: Iterable[str | None]) -> list[str]:
    """Return a unique name for each band."""
    given = [*descriptions]
    other = ["elevation"] if len(given) == 1 else [f"band_{n}" for n in range(1, len(given) + 1)]
    names: dict[str, None] = {}
    for name, replacement in zip(given, other, strict=True):
        chosen = name if name and name not in names else replacement
        if chosen in names:
            raise GridMapError(f"two bands have one name: {chosen}")
        names[chosen] = None
    return [*names]


def _read_bands(raster: Any, bands: Mapping[str, int], names: Sequence[str]) -> list[Layer]:
    """Return layers in map order."""
    shape = raster.width, raster.height
    layers = [np.empty(shape, np.float32, order="F") for _ in names]
    images = [to_north_up(layer) for layer in layers]
    whole = slice(0, raster.height), slice(0, raster.width)
    read_pixels(raster, [bands[name] for name in names], whole, images)
    return layers


def read_pixels(
    raster: Any, bands: Sequence[int], window: tuple[slice, slice], images: Sequence[Layer]
) -> None:
    """Read a window of some bands, with masks as NaN, scales and offsets.

    Args:
        raster: the open dataset.
        bands: numbers of the bands, from 1 on.
        window: lines and pixels of the raster.
        images: what is filled: for each band (lines, pixels) float32, of any strides.

    Raises:
        ValueError: a band has complex numbers.
    """
    for band in bands:
        if "complex" in (kind := raster.dtypes[band - 1]):
            raise ValueError(f"expected real numbers, got {kind} in band {band}")
    top, left = (side.start for side in window)
    for part in _windows(raster, window):
        # GDAL holds the blocks of a window, so that no band unpacks those of all bands again.
        (above, below), (west, east) = part.toranges()
        for band, image in zip(bands, images, strict=True):
            _read_band(
                raster, band, part, image[above - top : below - top, west - left : east - left]
            )


_EXACT = frozenset(["uint8", "int8", "uint16", "int16", "float32"])
"""Types of pixels whose numbers are float32 numbers."""

_NODATA_ULPS = 4 * float(np.finfo(np.float32).eps)
"""Relative difference of numbers up to which GDAL takes a float32 for the value of no data."""


def _read_band(raster: Any, band: int, window: Any, image: Layer) -> None:
    """Read a window of a band into an image."""
    flags = {flag.name for flag in raster.mask_flag_enums[band - 1]}
    if raster.dtypes[band - 1] in _EXACT and flags <= {"nodata", "all_valid"}:
        # GDAL writes into the layer itself, and reads no mask, which unpacks blocks again.
        raster.read(band, window=window, out=image)
        if "nodata" in flags:
            _without(image, raster.nodatavals[band - 1], raster.dtypes[band - 1])
    else:
        values = raster.read(band, window=window, masked=True)
        image[...] = values.astype(np.float32).filled(np.nan)
    scale_pixels(raster, band, image)


def scale_pixels(raster: Any, band: int, image: Layer) -> None:
    """Apply the scale and the offset of a band."""
    scale, offset = raster.scales[band - 1], raster.offsets[band - 1]
    if (scale, offset) != (1.0, 0.0):
        image *= scale
        image += offset


def _without(image: Layer, nodata: float, kind: str) -> None:
    """Put NaN in place of the value of no data."""
    if math.isnan(nodata):
        return
    if kind == "float32" and math.isfinite(nodata):
        largest = float(np.finfo(np.float32).max)
        around = _NODATA_ULPS * abs(nodata)
        lower, upper = max(nodata - around, -largest), min(nodata + around, largest)
        image[(image >= lower) & (image <= upper)] = np.nan
    else:
        image[image == nodata] = np.nan


def _windows(raster: Any, within: tuple[slice, slice]) -> Iterator[Any]:
    """Yield the parts of a window: of at most `_WINDOW` bytes of blocks, or of one block."""
    window = import_module("rasterio.windows").Window
    rows, columns = raster.block_shapes[0]
    first_row, first_column = within[0].start // rows * rows, within[1].start // columns * columns
    blocks = max(1, _WINDOW // block_bytes(raster))
    across = min(blocks, -(-(within[1].stop - first_column) // columns))
    rows, columns = rows * (blocks // across), columns * across
    for top in range(first_row, within[0].stop, rows):
        lines = max(top, within[0].start), min(top + rows, within[0].stop)
        for left in range(first_column, within[1].stop, columns):
            pixels = max(left, within[1].start), min(left + columns, within[1].stop)
            yield window.from_slices(lines, pixels)


def block_bytes(raster: Any) -> int:
    """Return the unpacked size of a block of all its bands [bytes]."""
    rows, columns = raster.block_shapes[0]
    # `profile` would take as long as reading a window.
    order = raster.tags(ns="IMAGE_STRUCTURE").get("INTERLEAVE")
    together = raster.count if order == "PIXEL" else 1
    size = 16 if "complex" in raster.dtypes[0] else np.dtype(raster.dtypes[0]).itemsize
    return int(rows * columns * together * size)
