# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""GeoTIFF files: a band of float32 per layer, called like it; NaN is no data.

Rows of a raster run to -y and columns to +x. Of a map there are besides, as tags of the file, its
frame, its time and its basic layers; the place is that of the raster, whoever has cut it since.
"""

import json
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.errors import GridMapError, LayerNotFoundError, MissingPackageError
from grid_map_core_py.files import new_file, storage_errors

from .errors import CommandError
from .output import message
from .reading import MapInfo, info_of

_TAG = "GRID_MAP"
_FRAME = "map"
"""Layer name of rasters without band names."""

_LARGEST_DIFFERENCE = 1e-6
"""Between the sides of a pixel, as part of them."""


def write_geotiff(grid_map: GridMap, path: str, *, crs: str, compress: bool) -> None:
    """Write a map.

    Args:
        grid_map: the map.
        path: the file; one that is there is replaced.
        crs: coordinate reference system of the frame, such as "EPSG:25832"; empty for none.
        compress: make the file smaller.

    Raises:
        CommandError: the map has no layers.
        GridMapError: the file cannot be written, the reference system is unknown, or rasterio is
            not installed.
    """
    rasterio = _rasterio(path)
    if not grid_map.layers:
        raise CommandError(f"{path}: the map has no layers, and a GeoTIFF needs one")
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
        # Four gigabytes are the end of what others can write.
        "BIGTIFF": "IF_SAFER",
    }
    if compress:
        # Differences of floats between neighbours are small; the predictor for floats is 3.
        profile |= {"compress": "deflate", "predictor": 3}
    tags = {
        "frame_id": grid_map.frame_id,
        "timestamp": grid_map.timestamp,
        "basic_layers": grid_map.basic_layers,
    }
    with (
        storage_errors(Path(path), "written"),
        new_file(path) as temporary,
        rasterio.open(temporary, "w", **profile) as raster,
    ):
        raster.update_tags(**{_TAG: json.dumps(tags)})
        for band, name in enumerate(grid_map, 1):
            raster.write(_to_raster(grid_map.unwrapped(name)), band)
            raster.set_band_description(band, name)


def read_geotiff(path: str, layers: Iterable[str] | None = None) -> GridMap:
    """Return the map in a raster file, also in one that others have written.

    Bands without a name are `elevation`, if there is only one, or `band_1` and so on. What is
    masked is NaN. Scales and offsets of bands are applied.

    Args:
        path: the file.
        layers: names of the layers to read; None means all.

    Raises:
        GridMapError: the file is damaged or no raster, its pixels are no squares along the axes, it
            lacks a layer, or rasterio is not installed.
    """
    with _opened(path) as raster:
        _warn_of_unit(raster, path)
        names = _names(raster.descriptions)
        wanted = names if layers is None else [*layers]
        for name in wanted:
            if name not in names:
                raise LayerNotFoundError(name, names)
        found = {name: _read_band(raster, names.index(name) + 1) for name in wanted}
        grid_map = _empty_map(raster).with_layers(found)
        grid_map.basic_layers = [name for name in _basic_layers(raster) if name in found]
        return grid_map


def geotiff_info(path: str) -> MapInfo:
    """Return what a raster file tells about its map; errors are those of `read_geotiff`."""
    with _opened(path) as raster:
        _warn_of_unit(raster, path)
        info = info_of(_empty_map(raster))
        names, basic = _names(raster.descriptions), _basic_layers(raster)
        return info._replace(
            layers=tuple(names),
            basic_layers=tuple(name for name in basic if name in names),
            crs=_crs_text(raster),
        )


def crs_of(path: str) -> str:
    """Return the reference system of a raster file, as `write_geotiff` takes it."""
    with _opened(path) as raster:
        return _crs_text(raster)


@contextmanager
def _opened(path: str) -> Iterator[Any]:
    """Open a raster for reading."""
    rasterio = _rasterio(path)
    with warnings.catch_warnings(), storage_errors(Path(path), "read"):
        warnings.simplefilter("ignore", rasterio.errors.NotGeoreferencedWarning)
        with rasterio.open(path) as raster:
            yield raster


def _warn_of_unit(raster: Any, path: str) -> None:
    """Say so if the coordinates are no metres."""
    unit = ""
    if raster.crs and raster.crs.is_geographic:
        unit = "degrees"
    elif raster.crs and raster.crs.is_projected:
        name, metres = raster.crs.linear_units_factor
        unit = "" if metres == 1.0 else f"units of {metres:.7g} m ({name})"
    if unit:
        message(
            f"warning: {path}: is in {unit}, which are taken for metres; "
            "'gdalwarp -t_srs EPSG:...' projects it"
        )


def _crs_text(raster: Any) -> str:
    return raster.crs.to_string() if raster.crs else ""


def _empty_map(raster: Any) -> GridMap:
    """Return the map without its layers."""
    tags = _tags(raster)
    return GridMap.from_geometry(
        _geometry(raster),
        frame_id=str(tags.get("frame_id", _FRAME)),
        timestamp=int(tags.get("timestamp", 0)),
    )


def _basic_layers(raster: Any) -> list[str]:
    return [str(name) for name in _tags(raster).get("basic_layers", ())]


def _tags(raster: Any) -> dict[str, Any]:
    tags = json.loads(raster.tags().get(_TAG, "{}"))
    if not isinstance(tags, dict):
        raise ValueError(f"its tag {_TAG} is damaged")
    return tags


def _rasterio(path: str) -> Any:
    try:
        return import_module("rasterio")
    except ImportError as error:
        raise MissingPackageError("rasterio", f"{path}: GeoTIFF", "pip install rasterio") from error


def _geometry(raster: Any) -> GridGeometry:
    step = raster.transform
    if raster.transform.is_identity:
        raise ValueError("does not say where it lies (no geotransform)")
    square = abs(step.a + step.e) <= _LARGEST_DIFFERENCE * abs(step.a)
    if step.b or step.d or not step.a > 0 or not square:
        raise ValueError(
            "expected square pixels with north up, found "
            f"{step.a:g} x {-step.e:g} turned by ({step.b:g}, {step.d:g}); 'gdalwarp' makes them so"
        )
    size = raster.width, raster.height
    corner = np.array([step.c, step.f])
    position = corner + np.array([0.5, -0.5]) * size * step.a
    return GridGeometry.from_size(size, step.a, position)


def _names(descriptions: Iterable[str | None]) -> list[str]:
    """Return a name for each band, no two alike."""
    given = [*descriptions]
    other = ["elevation"] if len(given) == 1 else [f"band_{n}" for n in range(1, len(given) + 1)]
    names: list[str] = []
    for name, replacement in zip(given, other, strict=True):
        names.append(name if name and name not in names else replacement)
    if len({*names}) != len(names):
        raise GridMapError(f"two bands have one name: {', '.join(names)}")
    return names


def _read_band(raster: Any, band: int) -> npt.NDArray[np.float32]:
    if "complex" in raster.dtypes[band - 1]:
        raise ValueError(f"expected real numbers, found {raster.dtypes[band - 1]} in band {band}")
    values = raster.read(band, masked=True)
    scale, offset = raster.scales[band - 1], raster.offsets[band - 1]
    pixels = values.astype(np.float32).filled(np.nan)
    if (scale, offset) != (1.0, 0.0):
        pixels = (pixels * scale + offset).astype(np.float32)
    return _from_raster(pixels)


def _to_raster(layer: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return a layer in map order as a raster, without a copy."""
    return layer[::-1, :].T


def _from_raster(pixels: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    return pixels.T[::-1, :]
