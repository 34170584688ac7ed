# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files with one float32 band per layer.

The description of a band is the name of its layer. NaN means no data. Raster rows run towards -y
and columns towards +x. A tag stores the frame, time and basic layers. The geotransform defines the
position, so rasters that another program cropped have the correct position.
"""

import json
import math
import os
import shlex
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays._checks import Layer, as_crs
from ..errors import GridMapError, required, wrong_crs
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ._image_files import to_north_up
from ._shared import StoredMap, check_ending, new_file, package_for, storage_errors

_TAG = "GRID_MAP"

_LARGEST_DIFFERENCE = 1e-6
"""Largest relative difference between the sides of a pixel that counts as square."""

_CACHE = 2**27
"""Size of GDAL's block cache in a process [bytes]; GDAL's default is 5 % of the memory."""


def save_geotiff(
    grid_map: GridMap, path: str | PathLike[str], *, crs: Any = "", compress: bool = False
) -> None:
    """Write a map to a GeoTIFF file.

    The file is written atomically. An existing file is replaced.

    Args:
        grid_map: the map; it is stored in map order.
        path: the file.
        crs: coordinate reference system of the frame: a code such as "EPSG:25832", WKT or a PROJ
            string. If empty, the `crs` of the map is used.
        compress: if True, compress the file with Deflate.
    """
    check_ending(path, ".tif", ".tiff")
    rasterio = package_for(path, "GeoTIFF", "rasterio")
    if not grid_map.layers:
        raise GridMapError(f"{path}: cannot be written: the map has no layers")
    grid_map = grid_map._in_crs(crs)
    # Python writes the file, because GDAL does not report if the disk is full.
    with storage_errors(Path(path), "written"), rasterio.MemoryFile() as memory:
        profile = raster_profile(grid_map, len(grid_map.layers), compress=compress)
        with memory.open(**profile) as raster:
            describe_raster(raster, grid_map, grid_map.layers)
            for band, name in enumerate(grid_map, 1):
                raster.write(to_north_up(grid_map.unwrapped(name)), band)
        with new_file(path) as temporary:
            temporary.write_bytes(memory.getbuffer())


def load_geotiff(path: str | PathLike[str], layers: Iterable[str] | None = None) -> GridMap:
    """Load a map from a GeoTIFF file written by `save_geotiff` or another program.

    If the only band is unnamed, it becomes the layer `elevation`. If there are several bands,
    unnamed bands become the layers `band_1`, `band_2` and so on. Masked pixels become NaN. Band
    scales and offsets are applied. If the coordinates are not in meters, a warning is issued.

    Args:
        path: the file, or a GDAL virtual file, such as `/vsicurl/https://...`.
        layers: names of the layers to read; None means all.

    Raises:
        GridMapError: the file is damaged or not a GeoTIFF, its pixels are not axis-aligned squares,
            a layer is missing, or rasterio is not installed.
    """
    with _opened(path) as stored:
        return stored.load(layers)


def describe_geotiff(path: str | PathLike[str]) -> dict[str, Any]:
    with _opened(path) as stored:
        return {"map": stored.facts()}


@contextmanager
def _opened(path: str | PathLike[str]) -> Iterator[StoredMap]:
    with storage_errors(Path(path), "read"), gdal(path), open_raster(path) as raster:
        if unit := unit_of(raster):
            warnings.warn(
                f"{path}: is in {unit}, which are treated as meters; "
                "'gdalwarp -t_srs EPSG:...' projects it",
                stacklevel=5,
            )
        geometry = geometry_of(raster, path)
        origin = origin_of(raster, path) or (0.0, 0.0)
        stored = stored_map(raster, path, geometry.at(geometry.position - origin))
        stored.empty._reference = raster.crs.to_wkt() if raster.crs else "", origin
        yield stored


# --- open rasters ---------------------------------------------------------------------------------


def gdal(path: str | PathLike[str], **options: Any) -> Any:
    """Return a rasterio environment that limits GDAL's block cache and logs GDAL errors."""
    if "GDAL_CACHEMAX" not in os.environ:
        options["GDAL_CACHEMAX"] = _CACHE
    return package_for(path, "GeoTIFF", "rasterio").Env(**options)


def open_raster(path: str | PathLike[str], overview: int | None = None) -> Any:
    """Open a file with rasterio. `overview` 0 has the most detail; None means full resolution."""
    level = {} if overview is None else {"overview_level": overview}
    return import_module("rasterio").open(os.fspath(path), **level)


def stored_map(raster: Any, path: str | PathLike[str], geometry: GridGeometry) -> StoredMap:
    tags = _tags_of(raster)
    names: list[str] = []
    for number, name in enumerate(raster.descriptions, 1):
        other = "elevation" if raster.count == 1 else f"band_{number}"
        names.append(name if name and name not in names else other)
    if len({*names}) < len(names):
        raise ValueError(f"two bands have one name: {', '.join(names)}")
    empty = GridMap.from_geometry(
        geometry,
        frame_id=str(tags.get("frame_id", "map")),
        timestamp=int(tags.get("timestamp", 0)),
    )

    def read(wanted: Sequence[str]) -> list[Layer]:
        layers = [np.empty(geometry.size, np.float32, order="F") for _ in wanted]
        bands = [names.index(name) + 1 for name in wanted]
        whole = slice(0, raster.height), slice(0, raster.width)
        read_pixels(raster, bands, whole, [to_north_up(layer) for layer in layers])
        return layers

    basic = [name for name in tags.get("basic_layers", ()) if name in names]
    return StoredMap(empty, names, basic, read, Path(path))


def origin_of(raster: Any, path: str | PathLike[str]) -> tuple[float, float] | None:
    """Return the frame origin in the reference system [m]; None if unknown or reprojected."""
    tags = _tags_of(raster)
    if "origin" not in tags:
        return None
    x, y = map(float, tags["origin"])
    if (raster.crs or "") != import_module("rasterio.crs").CRS.from_user_input(tags["crs"]):
        warnings.warn(
            f"{path}: has been projected; the frame of its map has another origin now", stacklevel=5
        )
        return None
    return x, y


def _tags_of(raster: Any) -> dict[str, Any]:
    return dict(json.loads(raster.tags().get(_TAG, "{}")))


def unit_of(raster: Any) -> str:
    """Return the coordinate unit of a raster, or "" for meters and unknown units."""
    if raster.crs and raster.crs.is_geographic:
        return "degrees"
    if raster.crs and raster.crs.is_projected:
        name, meters = raster.crs.linear_units_factor
        return "" if meters == 1.0 else f"units of {meters:.7g} m ({name})"
    return ""


def geometry_of(raster: Any, path: str | PathLike[str]) -> GridGeometry:
    """Return the geometry of a raster, or raise `ValueError` if a map cannot represent it."""
    step = raster.transform
    if step.is_identity:
        raise ValueError(
            "has no position (no geotransform); 'resolution' reads it as a height image"
        )
    square = abs(step.a + step.e) <= _LARGEST_DIFFERENCE * abs(step.a)
    if step.b or step.d or not step.a > 0 or not square:
        side = f"{math.sqrt(abs(step.determinant)):.12g}"
        target = Path(path).with_name(f"{Path(path).stem}_north_up.tif")
        words = ["gdalwarp", "-r", "bilinear", "-tr", side, side, f"{path}", f"{target}"]
        raise ValueError(
            f"expected square pixels with north up, got {step.a:g} x {-step.e:g} turned by "
            f"({step.b:g}, {step.d:g}); to fix this, run: {shlex.join(words)}"
        )
    size = raster.width, raster.height
    position = np.array([step.c, step.f]) + np.array([0.5, -0.5]) * size * step.a
    return GridGeometry.from_size(size, step.a, position)


def read_pixels(
    raster: Any, bands: Sequence[int], window: tuple[slice, slice], images: Sequence[Layer]
) -> None:
    """Read a window of several bands, set masked pixels to NaN, and apply scales and offsets.

    Args:
        bands: band numbers, starting at 1.
        window: line and pixel slices of the raster.
        images: output arrays (lines, pixels) float32, one per band, with any strides.
    """
    if not bands:
        return
    rectangle = import_module("rasterio.windows").Window.from_slices(*window)
    # Access each property only once, because each access visits all bands.
    terms = [*zip(raster.scales, raster.offsets, strict=True)]
    for band in bands:
        scale, offset = terms[band - 1]
        if not (math.isfinite(scale) and math.isfinite(offset)):
            raise ValueError(
                f"band {band}: expected a finite scale and offset, got {scale:g} and {offset:g}. "
                "'gdal_edit.py -scale 1 -offset 0' resets those of all bands"
            )
    kinds = {flag.name for flags in raster.mask_flag_enums for flag in flags}
    is_plain = kinds == {"nodata"} and all(map(math.isnan, raster.nodatavals))
    # Read all bands at once; otherwise GDAL unpacks interleaved blocks once for each band.
    found = raster.read([*bands], window=rectangle, masked=not is_plain)
    if np.iscomplexobj(found):
        raise ValueError(f"expected real numbers, got {found.dtype}")
    for band, image, values in zip(bands, images, found, strict=True):
        image[...] = np.ma.filled(values.astype(np.float32), np.nan)
        if kinds == {"all_valid"}:
            _warn_of_fill(raster, image[np.isfinite(image)])
        if (term := terms[band - 1]) != (1.0, 0.0):
            # In float32, large values would lose digits before the offset makes them small.
            image[...] = np.ma.filled(values.astype(np.float64) * term[0] + term[1], np.nan)


def _warn_of_fill(raster: Any, values: Layer) -> None:
    """Warn if many pixels share an extreme value, probably an undeclared nodata value."""
    for fill in map(float, (values.min(initial=0.0), values.max(initial=0.0))):
        # Common nodata values are at least 999 away from 0.
        others = values[values != fill].astype(np.float64) if abs(fill) > 900.0 else values[:0]
        is_many = 0 < others.size < 0.99 * values.size
        if is_many and np.abs(others - fill).min() > np.ptp(others) > 0:
            text = f"{raster.name}: {fill:g} fills many cells, and no nodata value is declared"
            remedy = f"'gdal_edit.py -a_nodata {fill:.9g} {raster.name}' declares it"
            warnings.warn(f"{text}; {remedy}", stacklevel=6)


def checked_crs(crs: Any) -> str:
    """Return a reference system as text, or raise `ConfigError` if it is invalid."""
    if text := as_crs(crs):
        rasterio = required("rasterio", "crs")
        try:
            with rasterio.Env():  # keeps PROJ from printing its own message
                rasterio.crs.CRS.from_user_input(text)
        except ValueError:  # a malformed number, or rasterio's CRSError, which is a subclass
            raise wrong_crs(crs) from None
    return text


def raster_profile(described: Any, layers: int, *, compress: bool) -> dict[str, Any]:
    geometry, step = described.geometry, described.resolution
    west, north = geometry.position + described.origin + [-0.5, 0.5] * geometry.length
    profile = {
        "driver": "GTiff",
        "width": geometry.size[0],
        "height": geometry.size[1],
        "count": layers,
        "dtype": "float32",
        "nodata": np.nan,
        "transform": import_module("affine").Affine(step, 0.0, west, 0.0, -step, north),
        "crs": checked_crs(described.crs) or None,
        # A classic TIFF holds at most 4 GB.
        "BIGTIFF": "IF_SAFER",
    }
    # Predictors improve the compression of smooth layers; 3 is the predictor for floats.
    return profile | ({"compress": "deflate", "predictor": 3} if compress else {})


def describe_raster(raster: Any, described: Any, layers: Sequence[str]) -> None:
    """Write layer names and the metadata of a map or tiled map to an open raster."""
    facts = {
        "frame_id": described.frame_id,
        "timestamp": described.timestamp,
        "basic_layers": [name for name in described.basic_layers if name in layers],
    }
    if any(described.origin):
        facts |= {"origin": described.origin, "crs": described.crs}
    raster.update_tags(**{_TAG: json.dumps(facts)})
    raster.descriptions = tuple(layers)
