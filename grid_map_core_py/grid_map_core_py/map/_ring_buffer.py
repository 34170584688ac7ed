# SPDX-License-Identifier: BSD-3-Clause
"""The circular buffer (ring buffer) that stores the layers of a map.

`start` is the buffer row and column at which cell (0, 0) of the map is stored. Moving the map
changes `start` but does not copy data, so rows and columns may wrap around the end of the buffer.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .._arrays._checks import Integers, Layer, Size

_FEW = 2**14  # number of cells above which arithmetic is faster than a lookup


@dataclass(frozen=True)
class BufferRegion:
    """A rectangle of cells in the circular buffer.

    Attributes:
        start_index: buffer indices of the first row and column.
        size: number of rows and columns.
    """

    start_index: Size
    size: Size

    @property
    def slices(self) -> tuple[slice, slice]:
        """Slices that select the region in a layer: `layer[region.slices]`."""
        (row, column), (rows, columns) = self.start_index, self.size
        return slice(row, row + rows), slice(column, column + columns)


@lru_cache(maxsize=16)
def lines(size: int, start: int) -> Integers:
    """Return the buffer row or column (size,) of each map row or column. The array is read-only."""
    numbers = np.concatenate((np.arange(start, size), np.arange(start)))
    numbers.flags.writeable = False
    return numbers


def place(numbers: Integers, start: int, size: int) -> None:
    """Convert map rows or columns (N,) to buffer indices, in place."""
    if start and numbers.size < _FEW:
        lines(size, start).take(numbers, mode="clip", out=numbers)
    elif start:
        # For many cells, two passes of arithmetic are faster than a lookup.
        numbers += start
        unsigned = numbers.view(np.uint64)
        # Below `size`, the unsigned difference wraps to a huge number, and the index is kept.
        np.minimum(unsigned, unsigned - np.uint64(size), out=unsigned)


def block(
    layer: Layer, start: Size, rows: slice, columns: slice, out: Layer | None = None
) -> Layer:
    """Copy a block of a layer, in map order, to `out` or a new array."""
    if out is None:
        shape = rows.stop - rows.start, columns.stop - columns.start
        out = np.empty(shape, layer.dtype, "F")
    for source, target in copies(start, layer.shape, rows, columns):
        out[target] = layer[source]
    return out


def copies(
    start: Size, size: Size, rows: slice, columns: slice
) -> list[tuple[tuple[slice, slice], tuple[slice, slice]]]:
    """Return (buffer, block) slices of the 1 to 4 parts into which wrapping splits a block."""
    in_columns = _pieces(columns, start[1], size[1])
    return [
        ((from_rows, from_columns), (to_rows, to_columns))
        for from_rows, to_rows in _pieces(rows, start[0], size[0])
        for from_columns, to_columns in in_columns
    ]


def unwrapped(layer: Layer, start: Size, out: Layer | None = None) -> Layer:
    """Return a copy of a layer in map order."""
    rows, columns = layer.shape
    return block(layer, start, slice(0, rows), slice(0, columns), out)


def uncovered(start: Size, size: Size, shift: Size) -> list[BufferRegion]:
    """Return the buffer regions of the new cells after a move by `shift` cells."""
    (row, column), (rows, columns), (down, right) = start, size, shift
    if abs(down) >= rows or abs(right) >= columns:
        return [BufferRegion((0, 0), size)]
    strips = _runs(row + min(down, 0), abs(down), rows)
    regions = [BufferRegion((first, 0), (count, columns)) for first, count in strips]
    strips = _runs(column + min(right, 0), abs(right), columns)
    return regions + [BufferRegion((0, first), (rows, count)) for first, count in strips]


def _pieces(cells: slice, start: int, size: int) -> list[tuple[slice, slice]]:
    """Return (buffer, block) slices of map rows or columns, split at the buffer end."""
    count, done, pieces = cells.stop - cells.start, 0, []
    for first, length in _runs(cells.start + start, count, size):
        pieces.append((slice(first, first + length), slice(done, done + length)))
        done += length
    return pieces


def _runs(first: int, count: int, size: int) -> list[tuple[int, int]]:
    """Return runs (first, count) of buffer rows or columns, split at the buffer end."""
    first %= size
    before_end = size - first
    if count <= before_end:
        return [(first, count)] if count else []
    return [(first, before_end), (0, count - before_end)]
