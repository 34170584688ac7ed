# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files: one band of float32 per layer, described by its name; NaN is no data.

Rows of a raster run to -y and columns to +x. A tag holds the frame, the time and the basic layers
of the map. The position comes from the raster, so a raster that was cropped elsewhere is right.
"""

import json
import math
import os
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays._checks import Layer
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
    expected = "a code such as 'EPSG:25832', WKT or a string of PROJ without files"
    check(not crs or bool(_CRS.fullmatch(crs)), "crs", expected, crs)
    rows, columns = grid_map.size
    west, north = (grid_map.position + [-0.5, 0.5] * grid_map.length).tolist()
    step = grid_map.resolution
    profile = {
        "driver": "GTiff",
        "width": rows,
        "height": columns,
        "count": len(grid_map.layers),
        "dtype": "float32",
        "nodata": np.nan,
        "transform": rasterio.Affine(step, 0.0, west, 0.0, -step, north),
        "crs": crs or None,
        # A classic TIFF holds at most 4 GB.
        "BIGTIFF": "IF_SAFER",
    }
    if compress:
        # Differences of floats between neighbors are small; the predictor for floats is 3.
        profile |= {"compress": "deflate", "predictor": 3}
    tags = {
        "frame_id": grid_map.frame_id,
        "timestamp": grid_map.timestamp,
        "basic_layers": grid_map.basic_layers,
    }
    # GDAL reports no error if the disk or the memory is full while it closes a file. Therefore
    # Python writes the bytes, after a check that GDAL reads the same from them.
    with storage_errors(Path(path), "written"), rasterio.MemoryFile() as memory:
        with memory.open(**profile) as raster:
            raster.update_tags(**{_TAG: json.dumps(tags)})
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
    with _opened(path, virtual=virtual) as (_, stored):
        return stored.load(layers)


def describe_geotiff(path: str | PathLike[str], *, virtual: bool = False) -> dict[str, Any]:
    """Return what the file tells about its map; errors are those of `load_geotiff`."""
    with _opened(path, virtual=virtual) as (raster, stored):
        crs = {"crs": raster.crs.to_string()} if raster.crs else {}
        return {"map": crs | stored.facts()}


def open_raster(path: str | PathLike[str], *, virtual: bool = False) -> Any:
    """Return the open dataset of rasterio for a GeoTIFF file; no other file is opened.

    Rasters of other formats (VRT), auxiliary files beside the raster and some metadata can name
    any file and any address. Therefore GDAL may use its driver for GeoTIFF only, reads no file
    beside the raster, and takes the path for that of a file.

    Args:
        path: the file.
        virtual: let the path name a virtual file of GDAL.

    Raises:
        MissingPackageError: rasterio is not installed.
        OSError, ValueError: the file is damaged, no GeoTIFF, or other files belong to its values.
    """
    rasterio = package_for(path, "GeoTIFF", "rasterio")
    name = str(path if virtual else Path(path).absolute())
    if name.startswith("/vsi") and not virtual:
        raise ValueError("expected the path of a file; 'virtual=True' takes those of GDAL")
    packed = math.inf if virtual else _checked_length(Path(name))
    _check_beside(Path(f"{name}.msk"), b"")
    _check_beside(Path(f"{name}.aux.xml"), rb"<(NoDataValue|Offset|Scale)\b")
    alone = rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR", GDAL_PAM_ENABLED=False)
    with alone:
        raster = rasterio.open(name, driver="GTiff")
    if "OVERVIEW_FILE" in raster.tags(ns="OVERVIEWS"):
        raster.close()
        raise ValueError("expected overviews in the same file")
    try:
        _check_block(raster, f"{path}", packed)
    except LimitError:
        raster.close()
        raise
    return raster


def _check_block(raster: Any, name: str, packed: float) -> None:
    """Raise `LimitError` if GDAL would unpack too much at once."""
    check_tiles(name, raster.shape, raster.block_shapes[0])
    check_bytes(f"{name}: block", _block_bytes(raster), packed)


def _checked_length(file: Path) -> int:
    """Return the length of a file [bytes] after a check of the tiles that it claims."""
    with file.open("rb") as stream:
        length = os.fstat(stream.fileno()).st_size
        if stream.read(4) in HEADS:
            check_tiff(f"{file}", stream)
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
def _opened(path: str | PathLike[str], *, virtual: bool) -> Iterator[tuple[Any, StoredMap]]:
    """Open a raster; yield it and its map."""
    with storage_errors(Path(path), "read"), open_raster(path, virtual=virtual) as raster:
        _warn_of_unit(raster, path)
        tags = json.loads(raster.tags().get(_TAG, "{}"))
        if not isinstance(tags, dict):
            raise ValueError(f"its tag {_TAG} is damaged")
        frame_id, timestamp = str(tags.get("frame_id", "map")), int(tags.get("timestamp", 0))
        geometry = _geometry(raster, path)
        empty = GridMap.from_geometry(geometry, frame_id=frame_id, timestamp=timestamp)
        names = _names(raster.descriptions)
        bands = {name: band for band, name in enumerate(names, 1)}
        basic = [name for name in tags.get("basic_layers", ()) if name in bands]
        read = partial(_read_bands, raster, bands)
        packed = math.inf if virtual else Path(path).stat().st_size
        yield raster, StoredMap(empty, names, basic, read, Path(path), packed)


def _warn_of_unit(raster: Any, path: str | PathLike[str]) -> None:
    """Warn if the coordinates are not meters."""
    unit = ""
    if raster.crs and raster.crs.is_geographic:
        unit = "degrees"
    elif raster.crs and raster.crs.is_projected:
        name, meters = raster.crs.linear_units_factor
        unit = "" if meters == 1.0 else f"units of {meters:.7g} m ({name})"
    if unit:
        warnings.warn(
            f"{path}: is in {unit}, which are taken for meters; "
            "'gdalwarp -t_srs EPSG:...' projects it",
            stacklevel=6,
        )


def _geometry(raster: Any, path: str | PathLike[str]) -> GridGeometry:
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
            f"{step.a:g} x {-step.e:g} turned by ({step.b:g}, {step.d:g}); 'gdalwarp' makes them so"
        )
    size = raster.width, raster.height
    corner = np.array([step.c, step.f])
    position = corner + np.array([0.5, -0.5]) * size * step.a
    return GridGeometry.from_size(size, step.a, position)


def _names(descriptions: Iterable[str | None]) -> list[str]:
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
    wanted = [bands[name] for name in names]
    for band in wanted:
        if "complex" in (kind := raster.dtypes[band - 1]):
            raise ValueError(f"expected real numbers, got {kind} in band {band}")
    shape = raster.width, raster.height
    layers = [np.empty(shape, np.float32, order="F") for _ in wanted]
    for window in _windows(raster):
        # GDAL holds the blocks of a window, so that no band unpacks those of all bands again.
        for band, layer in zip(wanted, layers, strict=True):
            values = raster.read(band, window=window, masked=True)
            scale, offset = raster.scales[band - 1], raster.offsets[band - 1]
            pixels = values.astype(np.float32).filled(np.nan)
            if (scale, offset) != (1.0, 0.0):
                pixels = pixels * scale + offset
            to_north_up(layer)[window.toslices()] = pixels
    return layers


def _windows(raster: Any) -> Iterator[Any]:
    """Yield windows of whole blocks, of at most `_WINDOW` bytes if a block is not larger."""
    window = import_module("rasterio.windows").Window
    rows, columns = raster.block_shapes[0]
    blocks = max(1, _WINDOW // _block_bytes(raster))
    across = min(blocks, -(-raster.width // columns))
    rows, columns = rows * (blocks // across), columns * across
    for top in range(0, raster.height, rows):
        for left in range(0, raster.width, columns):
            size = min(columns, raster.width - left), min(rows, raster.height - top)
            yield window(left, top, *size)


def _block_bytes(raster: Any) -> int:
    """Return the unpacked size of a block of all its bands [bytes]."""
    rows, columns = raster.block_shapes[0]
    together = raster.count if raster.profile.get("interleave") == "pixel" else 1
    size = 16 if "complex" in raster.dtypes[0] else np.dtype(raster.dtypes[0]).itemsize
    return int(rows * columns * together * size)
