# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Height maps as gray images, and what all files with images of maps share.

In files, up is +y and right is +x, as in GeoTIFF, nav2's `map_server` and RViz's view from above.
In arrays of `grid_map_core_py.conversions`, up is +x, as in the images of the C++ package.

The file of a height map holds only pixels: the caller gives the size of a pixel and the heights of
black and of white.
"""

import re
import struct
import zlib
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from ..arrays._checks import select_layers
from ..conversions._image_arrays import Image, from_image, to_image
from ..errors import GridMapError, LayerNotFoundError
from ..map._grid_map import GridMap
from ._atomic import new_file
from ._shared import storage_errors

HEIGHT_ENDINGS = (".png", ".tif", ".tiff")
"""Endings of height maps that are written."""

_TYPES = {8: np.uint8, 16: np.uint16, 32: np.float32}

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_MAGIC = re.compile(_PNG_MAGIC + rb"|II[*+]\0|MM\0[*+]|BM|P[1-6]\s|\xff\xd8\xff")
"""Beginnings of PNG, TIFF, BMP, PNM and JPEG files; OpenCV may hand other files to GDAL."""
_PGM_HEAD = re.compile(rb"P[25]\s+(?:#.*\s+)*\d+\s+(?:#.*\s+)*\d+\s+(?:#.*\s+)*(\d+)\s")
"""Kind, width, height and the value of white; comments may stand between."""


def load_height_image(
    path: str | PathLike[str],
    layers: Iterable[str] | None = None,
    *,
    resolution: float | None = None,
    lower: float = 0.0,
    upper: float = 1.0,
    height_layer: str = "elevation",
    position: npt.ArrayLike = (0.0, 0.0),
    frame_id: str = "map",
) -> GridMap:
    """Return a map with one layer that holds the heights in an image.

    Pixels that are transparent by more than half are NaN, and so is NaN in an image of floats.
    Colors count as gray by their luma.

    Args:
        path: a PNG, TIFF, BMP or PGM file of uint8, uint16, float32 or float64.
        layers: None, or the name of the only layer.
        resolution: side of a pixel [m]; required.
        lower, upper: heights of black and of white [m]. An image of floats holds the heights
            themselves and takes neither.
        height_layer: name of the layer.
        position: (2,) center of the map [m].
        frame_id: frame of the map.

    Raises:
        LayerNotFoundError: `layers` asks for another layer.
        GridMapError: the file cannot be read or is no image, `resolution` is missing, or a bound
            is invalid.
    """
    file = Path(path)
    with storage_errors(file, "read"):
        pixels = read_image(file)
    if resolution is None:
        height, width = pixels.shape[:2]
        raise GridMapError(
            f"{path}: resolution: expected the side of a pixel [m], got nothing; "
            f"the image has {width} x {height} pixels"
        )
    if pixels.dtype.kind == "f" and (lower, upper) != (0.0, 1.0):
        raise GridMapError(
            f"{path}: lower and upper: expected none, got {lower} and {upper}; "
            "an image of floats holds the heights themselves"
        )
    grid_map = from_image(
        from_north_up(pixels),
        *(height_layer, resolution, lower, upper),
        position=position,
        frame_id=frame_id,
    )
    select_layers(grid_map, layers)  # raises if it asks for another one
    return grid_map


def save_height_image(
    grid_map: GridMap,
    path: str | PathLike[str],
    *,
    layer: str | None = None,
    bits: int | None = None,
    lower: float | None = None,
    upper: float | None = None,
) -> None:
    """Write one layer as a height image.

    The file is written atomically; an existing one is replaced. NaN becomes transparent,
    and stays NaN in an image of float32.

    Args:
        grid_map: the map; a moved one is stored in map order.
        path: the file; its name ends in .png, .tif or .tiff.
        layer: the layer; None means the only one, or `elevation`.
        bits: 8 or 16; 32 writes float32, for TIFF only. None means 16 for PNG and 32 for TIFF.
        lower, upper: heights of black and of white [m]; None means the smallest and the largest
            finite value. An image of float32 holds the heights themselves and takes neither.

    Raises:
        LayerNotFoundError: the map lacks the layer.
        GridMapError: an option is invalid, or the file cannot be written.
    """
    file = Path(path)
    ending = file.suffix.lower()
    if ending not in HEIGHT_ENDINGS:
        expected = " or ".join(HEIGHT_ENDINGS)
        raise GridMapError(f"{path}: expected a name that ends in {expected}, got {ending!r}")
    if bits is None:
        bits = 16 if ending == ".png" else 32
    allowed = (8, 16) if ending == ".png" else (8, 16, 32)
    if bits not in allowed:
        expected = ", ".join(map(str, allowed))
        raise GridMapError(f"{path}: bits: expected one of {expected}, got {bits!r}")
    if bits == 32 and (lower, upper) != (None, None):
        raise GridMapError(
            f"{path}: lower and upper: expected none, got {lower} and {upper}; "
            "an image of float32 holds the heights themselves"
        )
    name = chosen_layer(grid_map, layer, "elevation")
    has_holes = bits != 32 and bool(np.isnan(grid_map[name]).any())
    image = to_image(grid_map, name, _TYPES[bits], 4 if has_holes else 1, lower, upper)
    with storage_errors(file, "written"):
        write_image(file, to_north_up(image))


def chosen_layer(grid_map: GridMap, layer: str | None, usual: str) -> str:
    """Return the layer that is asked for, else the one with the usual name, else the only one."""
    if layer is None and usual not in grid_map and len(grid_map.layers) == 1:
        return grid_map.layers[0]
    name = usual if layer is None else layer
    if name not in grid_map:
        raise LayerNotFoundError(name, grid_map.layers)
    return name


def to_north_up(image: Image) -> Image:
    """Return an image in map order (up is +x, left is +y) with +y up and +x to the right."""
    return image.swapaxes(0, 1)[:, ::-1]


def from_north_up(image: Image) -> Image:
    """Return an image with +y up and +x to the right in map order, the inverse of `to_north_up`."""
    return image[:, ::-1].swapaxes(0, 1)


def encode_image(image: Image, ending: str) -> bytes:
    """Return the bytes of an image file with the ending, such as ".png"."""
    done, data = cv2.imencode(ending, np.ascontiguousarray(image))
    if not done:
        raise ValueError(f"OpenCV cannot encode this image as {ending}")
    return data.tobytes()


def write_image(file: Path, image: Image) -> None:
    """Write an image to a file, complete or not at all."""
    data = encode_image(image, file.suffix.lower())
    with new_file(file) as temporary:
        temporary.write_bytes(data)


def read_image(file: Path, size: tuple[int, int] | None = None) -> Image:
    """Return the pixels of a PNG, TIFF, BMP, PNM or JPEG file.

    Args:
        file: the image.
        size: rows and columns that a PNG image must have; it is refused before memory is taken.

    Returns:
        (rows, cols) gray, (rows, cols, 3) BGR or (rows, cols, 4) BGRA; uint8, uint16 or floats.

    Raises:
        OSError, ValueError: the file cannot be read, is damaged, or of another size.
    """
    data = file.read_bytes()
    if data.startswith(_PNG_MAGIC):
        _check_png(data, size)
    elif size is not None:
        raise ValueError("no PNG image")
    known = _MAGIC.match(data)
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if known else None
    if pixels is None:
        raise ValueError("no image, or a damaged one")
    head = _PGM_HEAD.match(data)
    if head:
        # OpenCV returns the values unscaled, whatever maximum value the file declares.
        white, largest = int(head[1]), 255 if pixels.dtype == np.uint8 else 65535
        if white != largest:
            pixels = np.rint(pixels * (largest / white)).astype(pixels.dtype)
    return pixels


def _check_png(data: bytes, size: tuple[int, int] | None) -> None:
    """Refuse a PNG image that is cut off, damaged or of another size."""
    kinds, start = [], len(_PNG_MAGIC)
    while start < len(data):
        length, kind = struct.unpack_from(">I4s", data, start)
        content = data[start + 8 : start + 8 + length]
        (checksum,) = struct.unpack_from(">I", data, start + 8 + length)
        if zlib.crc32(content, zlib.crc32(kind)) != checksum:
            raise ValueError("a damaged PNG image: a checksum is wrong")
        if kind == b"IHDR" and size is not None:
            width, height = struct.unpack(">II", content[:8])
            if (height, width) != size:
                rows, columns = size
                raise ValueError(f"expected {columns} x {rows} pixels, got {width} x {height}")
        kinds.append(kind)
        start += 12 + length
    if kinds[:1] != [b"IHDR"] or kinds[-1] != b"IEND" or kinds.count(b"IHDR") != 1:
        raise ValueError("a PNG image that is cut off")
