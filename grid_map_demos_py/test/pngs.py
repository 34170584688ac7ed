# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A PNG writer independent of OpenCV, so that the order of colors is certain."""

import struct
import zlib
from pathlib import Path

import numpy as np

COLOR_TYPES = {1: 0, 3: 2, 4: 6}
"""Color types of PNG by number of channels: gray, red-green-blue, both also with alpha."""


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write (rows, cols, 1, 3 or 4) red, green, blue, alpha as uint8 or uint16."""
    rows, columns, channels = pixels.shape
    big_endian = pixels.astype(pixels.dtype.newbyteorder(">"))
    lines = b"".join(b"\0" + line.tobytes() for line in big_endian)
    bits = 8 * pixels.dtype.itemsize
    head = struct.pack(">IIBBBBB", columns, rows, bits, COLOR_TYPES[channels], 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(lines)), (b"IEND", b"")]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks))


def _chunk(kind: bytes, content: bytes) -> bytes:
    checksum = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)
