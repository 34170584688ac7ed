# SPDX-License-Identifier: BSD-3-Clause
"""Sizes that TIFF and BigTIFF files claim, read before a library allocates memory for them."""

import os
import struct
from collections.abc import Iterator
from contextlib import suppress
from typing import BinaryIO

from ..limits import check_cells, check_visits

HEADS = {
    b"II*\0": ("<", 4, "H", "I"),
    b"MM\0*": (">", 4, "H", "I"),
    b"II+\0": ("<", 8, "Q", "Q"),
    b"MM\0+": (">", 8, "Q", "Q"),
}
"""Byte order, place and size of the first directory's offset, types of a count and of an offset."""

_KINDS = {1: "B", 3: "H", 4: "I", 6: "b", 8: "h", 9: "i", 16: "Q", 17: "q"}
"""Types of numbers that libtiff takes for sides."""

_SUBFILE, _COLUMNS, _ROWS, _TILE_COLUMNS, _TILE_ROWS = 254, 256, 257, 322, 323
_TAGS = frozenset([_SUBFILE, _COLUMNS, _ROWS, _TILE_COLUMNS, _TILE_ROWS])
_MASK = 4

_MOST_ENTRIES = 100_000
"""Maximum number of entries of all directories."""


def check_tiff(name: str, file: BinaryIO, *, whole: bool = True) -> tuple[int, int]:
    """Return rows and columns of the first image after a check of the tiles that hold it.

    Args:
        name: name of the file, for messages.
        file: the file. Another process may shorten it meanwhile, which would end a process that
            has mapped it.
        whole: False if only windows of the image will be read, so that it may have any size.

    Raises:
        LimitError: the image has too many cells, or it or a mask has too many in its tiles.
        ValueError: the file is damaged.
    """
    found: list[tuple[int, int]] = []
    with suppress(struct.error):
        for tags in _directories(file):
            if not found or tags[_SUBFILE] & _MASK:
                size, tile = (tags[_ROWS], tags[_COLUMNS]), (tags[_TILE_ROWS], tags[_TILE_COLUMNS])
                tile = max(tile[0], 1), max(tile[1], 1)
                check_tiles(name, size, tile, whole=whole)
                found.append(size)
    if not found:
        raise ValueError("no image, or a damaged one")
    return found[0]


def check_tiles(
    name: str, size: tuple[int, int], tile: tuple[int, int], *, whole: bool = True
) -> None:
    """Raise `LimitError` if an image or its tiles have too many cells.

    Args:
        name: name of the file, for messages.
        size: rows and columns of the image.
        tile: rows and columns of a tile.
        whole: False if only windows of the image will be read, so that it may have any size.
    """
    if min(size) < 1:
        raise ValueError("no image, or a damaged one")
    if whole:
        check_cells(f"{name}: image", size)
    check_cells(f"{name}: tile", tile)
    if not whole:
        return
    # A tile is unpacked as a whole, even if most of it lies beyond the image.
    rows, columns = (-(-side // step) * step for side, step in zip(size, tile, strict=True))
    check_visits(f"{name}: tiles", rows * columns)


def _directories(file: BinaryIO) -> Iterator[dict[int, int]]:
    """Yield the values of `_TAGS` in each directory: 0 if missing, the largest of several."""
    end = file.seek(0, os.SEEK_END)
    order, place, count_type, offset_type = HEADS[_read(file, 0, 4)]

    def number_at(start: int, kind: str) -> int:
        size = struct.calcsize(kind)
        (number,) = struct.unpack(order + kind, _read(file, min(start, end), size))
        return int(number)

    start, entries, length = number_at(place, offset_type), 0, 4 + 2 * place
    while start:
        count = number_at(start, count_type)
        entries += count + 1
        if entries > _MOST_ENTRIES:
            raise ValueError(f"its directories have more than {_MOST_ENTRIES} entries")
        start += struct.calcsize(count_type)
        directory = _read(file, start, length * count)
        tags = dict.fromkeys(_TAGS, 0)
        for entry in range(0, length * count, length):
            tag, kind = struct.unpack_from(order + "HH", directory, entry)
            if tag in _TAGS and kind in _KINDS:
                (number,) = struct.unpack_from(order + _KINDS[kind], directory, entry + 4 + place)
                tags[tag] = max(tags[tag], number)
        yield tags
        start = number_at(start + length * count, offset_type)


def _read(file: BinaryIO, start: int, size: int) -> bytes:
    """Return the bytes at a place of a file: fewer at its end."""
    file.seek(start)
    return file.read(size)
