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
from contextlib import suppress
from io import BytesIO
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
from ._atomic import new_file
from ._shared import check_length, naming, storage_errors
from ._tiff import HEADS, check_tiff

HEIGHT_ENDINGS = (".png", ".tif", ".tiff")
"""Endings of height maps that are written."""

_TYPES = {8: np.uint8, 16: np.uint16, 32: np.float32}

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_PNM_HEAD = re.compile(rb"P[1-6]\s+(?:#.*\s+)*(\d+)\s+(?:#.*\s+)*(\d+)\s")
"""Width and height; comments may stand between."""
_PGM_WHITE = re.compile(rb"P[25]\s+(?:#.*\s+)*\d+\s+(?:#.*\s+)*\d+\s+(?:#.*\s+)*(\d+)\s")
"""Value of white."""
_OLD_BMP = 12
"""Bytes of the oldest head, which has sides of 16 bits."""
_JPEG_MAGIC = b"\xff\xd8\xff"
_JPEG_MARKER = re.compile(rb"\xff+([^\x00\x01\xd0-\xd7\xff])", re.DOTALL)
"""Markers that a length follows, or the end. The bytes of a scan contain none."""
_JPEG_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
_JPEG_END, _JPEG_SCAN = 0xD9, 0xDA

MOST_SCANS = 100
"""Maximum number of scans of a JPEG image; a progressive one has some ten."""


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
    with naming(path):
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
        size: rows and columns that a PNG image must have.

    Returns:
        (rows, cols) gray, (rows, cols, 3) BGR or (rows, cols, 4) BGRA; uint8, uint16 or floats.

    Raises:
        OSError, ValueError: the file cannot be read, is damaged, or of another size.
        LimitError: the file has too many bytes, or the image too many pixels.
    """
    check_length(file)
    data = file.read_bytes()
    is_png = data.startswith(_PNG_MAGIC)
    if size is not None and not is_png:
        raise ValueError("no PNG image")
    claimed = check_tiff(f"{file}", BytesIO(data)) if data[:4] in HEADS else _claimed_size(data)
    if size not in (None, claimed):
        expected, found = (f"{columns} x {rows}" for rows, columns in (size, claimed))
        raise ValueError(f"expected {expected} pixels, got {found}")
    check_cells(f"{file}: image", claimed)
    if is_png:
        _check_png(data)
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if pixels is None:
        raise ValueError("no image, or a damaged one")
    head = _PGM_WHITE.match(data)
    if head:
        # OpenCV returns the values unscaled, whatever maximum value the file declares.
        white, largest = int(head[1]), 255 if pixels.dtype == np.uint8 else 65535
        if white != largest:
            pixels = np.rint(pixels * (largest / white)).astype(pixels.dtype)
    return pixels


def _claimed_size(data: bytes) -> tuple[int, int]:
    """Return rows and columns from the head of an image; OpenCV would allocate them at once."""
    with suppress(struct.error):
        if data.startswith(_PNG_MAGIC):
            columns, rows = struct.unpack_from(">II", data, 16)
            return rows, columns
        if data.startswith(b"BM"):
            (length,) = struct.unpack_from("<I", data, 14)
            columns, rows = struct.unpack_from("<HH" if length == _OLD_BMP else "<ii", data, 18)
            return abs(rows), columns
        if head := _PNM_HEAD.match(data):
            return int(head[2]), int(head[1])
        if data.startswith(_JPEG_MAGIC):
            return _jpeg_size(data)
    raise ValueError("no image, or a damaged one")


def _jpeg_size(data: bytes) -> tuple[int, int]:
    """Return rows and columns from the frame of a JPEG image; refuse it if it has many scans."""
    size, scans, start = None, 0, 2
    while marker := _JPEG_MARKER.search(data, start):
        kind, start = marker[1][0], marker.end()
        if kind == _JPEG_END:
            break
        if kind in _JPEG_FRAMES and size is None:
            rows, columns = struct.unpack_from(">HH", data, start + 3)
            size = rows, columns
        # Each scan goes over the whole image.
        scans += kind == _JPEG_SCAN
        if scans > MOST_SCANS:
            raise ValueError(f"a JPEG image of more than {MOST_SCANS} scans")
        start += struct.unpack_from(">H", data, start)[0]
    if size is None:
        raise ValueError("no image, or a damaged one")
    return size


def _check_png(data: bytes) -> None:
    """Refuse a PNG image that is cut off or damaged."""
    kinds, start = [], len(_PNG_MAGIC)
    while start < len(data):
        length, kind = struct.unpack_from(">I4s", data, start)
        content = data[start + 8 : start + 8 + length]
        (checksum,) = struct.unpack_from(">I", data, start + 8 + length)
        if zlib.crc32(content, zlib.crc32(kind)) != checksum:
            raise ValueError("a damaged PNG image: a checksum is wrong")
        kinds.append(kind)
        start += 12 + length
    if kinds[:1] != [b"IHDR"] or kinds[-1] != b"IEND" or kinds.count(b"IHDR") != 1:
        raise ValueError("a PNG image that is cut off")
