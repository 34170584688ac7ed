# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Pixels of image files, and the orientation that all files of maps share.

In files, up is +y and right is +x, as in GeoTIFF, nav2's `map_server` and RViz's view from above.
In arrays of `grid_map_core_py.conversions`, up is +x, as in the images of the C++ package.
"""

import re
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np

from ..conversions._image_arrays import Image
from ._atomic import new_file

_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"
_PGM_HEAD = re.compile(rb"P[25]\s+(?:#.*\s+)*\d+\s+(?:#.*\s+)*\d+\s+(?:#.*\s+)*(\d+)\s")
"""Kind, width, height and the value of white; comments may stand between."""


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
    """Return the pixels of a PNG, TIFF, BMP or PGM file.

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
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
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
