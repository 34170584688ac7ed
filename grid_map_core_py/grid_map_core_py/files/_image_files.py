# SPDX-License-Identifier: BSD-3-Clause
"""Height maps stored as gray images, and functions to read and write images of any kind.

In image files, +y is up and +x is right, as in GeoTIFF files, in Nav2's `map_server` and in the
top-down view of RViz. In the arrays of `grid_map_core_py.conversions`, +x is up, as in C++.

A height image stores only pixels. The caller provides the resolution, and the heights for black
and white.
"""

import re
import struct
from collections.abc import Iterable
from contextlib import suppress
from os import PathLike
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from .._arrays._checks import select_layers
from ..conversions._image_arrays import Image, from_image, to_image
from ..errors import GridMapError, LayerNotFoundError
from ..limits import check_cells
from ..map._grid_map import GridMap
from ._shared import new_file, say_crs_is_lost, storage_errors

HEIGHT_ENDINGS = (".png", ".tif", ".tiff")
"""File extensions of height images that `save_height_image` writes."""

_TYPES = {8: np.uint8, 16: np.uint16, 32: np.float32}

_PNM_HEAD = re.compile(rb"P([1-6])\s+(?:#.*\s+)*(\d+)\s+(?:#.*\s+)*(\d+)\s+(?:(?:#.*\s+)*(\d+)\s)?")
"""PNM header: kind, width, height and white value (not in bitmaps), with comments in between."""

_TIFF_SHORT = 3
"""TIFF type code of 16-bit integers."""


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
    """Load a gray image as a map with one height layer.

    Pixels that are more than half transparent become NaN. NaN in a floating-point image stays NaN.
    Color images are converted to gray (luma).

    Args:
        path: a PNG, TIFF, BMP or PGM file with uint8, uint16, float32 or float64 pixels.
        layers: names of the layers to load; only `height_layer` exists. None means all.
        resolution: side of a pixel [m]; required.
        lower, upper: heights of black and white pixels [m]; not allowed for floating-point images,
            which contain heights.
        height_layer: name of the layer.
        position: (2,) center of the map [m].
        frame_id: frame of the map.
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
    with storage_errors(path, "read"):
        grid_map = from_image(
            from_north_up(pixels),
            *(height_layer, resolution, lower, upper),
            position=position,
            frame_id=frame_id,
        )
    select_layers(grid_map, layers)  # raises if a layer is missing
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

    The file is written atomically. An existing file is replaced. NaN becomes transparent; in a
    float32 image, it stays NaN.

    Args:
        grid_map: the map; it is stored in map order.
        path: the file; its name ends in .png, .tif or .tiff.
        layer: name of the layer; None means `elevation` if it exists, else the only layer.
        bits: bits per pixel: 8, 16, or 32 (float32, TIFF only); None means 16 for PNG, 32 for TIFF.
        lower, upper: heights of black and white pixels [m]; None means the smallest and the largest
            finite value. They are not allowed for float32 images, which contain heights.
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
    say_crs_is_lost(grid_map, "an image")
    name = chosen_layer(grid_map, layer, "elevation")
    has_holes = bits != 32 and bool(np.isnan(grid_map[name]).any())
    image = to_image(grid_map, name, _TYPES[bits], 4 if has_holes else 1, lower, upper)
    with storage_errors(file, "written"):
        write_image(file, to_north_up(image))


def chosen_layer(grid_map: GridMap, layer: str | None, usual: str) -> str:
    """Return `layer`, or if it is None, `usual` if the map has it, else the only layer."""
    if layer is None and usual not in grid_map and len(grid_map.layers) == 1:
        return grid_map.layers[0]
    name = usual if layer is None else layer
    if name not in grid_map:
        raise LayerNotFoundError(name, grid_map.layers)
    return name


def to_north_up(image: Image) -> Image:
    """Rotate an image in map order (+x up, +y left) so that +y is up and +x is right."""
    return image.swapaxes(0, 1)[:, ::-1]


def from_north_up(image: Image) -> Image:
    return image[:, ::-1].swapaxes(0, 1)


def encode_image(image: Image, ending: str) -> bytes:
    done, data = cv2.imencode(ending, np.ascontiguousarray(image))
    if not done:
        raise ValueError(f"OpenCV cannot encode this image as {ending}")
    return data.tobytes()


def write_image(file: Path, image: Image) -> None:
    data = encode_image(image, file.suffix.lower())
    with new_file(file) as temporary:
        temporary.write_bytes(data)


def read_image(file: Path) -> Image:
    """Read the gray (rows, cols) or BGR(A) (rows, cols, 3 or 4) pixels of an image file."""
    data = file.read_bytes()
    with suppress(struct.error):
        check_cells(f"{file}: image", _claimed_size(data))
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if pixels is None:
        raise ValueError("not an image, or damaged")
    check_cells(f"{file}: image", pixels.shape)
    head = _PNM_HEAD.match(data)
    if head and head[1] in b"25":
        # OpenCV ignores the maximum value in the file header, so the pixels are scaled here.
        white, largest = int(head[4]), 255 if pixels.dtype == np.uint8 else 65535
        if white != largest:
            pixels = np.rint(pixels * (largest / white)).astype(pixels.dtype)
    return pixels


def _claimed_size(data: bytes) -> tuple[int, int]:
    """Return the rows and columns in an image header, or (0, 0) if they are not found."""
    if data.startswith(b"\x89PNG"):
        columns, rows = struct.unpack_from(">II", data, 16)
        return rows, columns
    if data.startswith(b"BM"):
        columns, rows = struct.unpack_from("<ii", data, 18)
        return abs(rows), columns
    if head := _PNM_HEAD.match(data):
        return int(head[3]), int(head[2])
    if data[:4] in (b"II*\0", b"MM\0*"):
        order, sides = "<" if data.startswith(b"I") else ">", {256: 0, 257: 0}
        (start,) = struct.unpack_from(f"{order}I", data, 4)
        (count,) = struct.unpack_from(f"{order}H", data, start)
        for place in range(start + 2, start + 2 + 12 * count, 12):
            tag, kind = struct.unpack_from(f"{order}HH", data, place)
            if tag in sides:
                form = "H" if kind == _TIFF_SHORT else "I"
                (sides[tag],) = struct.unpack_from(order + form, data, place + 8)
        return sides[257], sides[256]
    return 0, 0
