# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The circular buffer (ring buffer) that stores the layers of a map.

`start` is the place in the buffer where cell (0, 0) of the map is stored. Moving the map moves
`start` and leaves the data where it is, so that rows and columns may wrap around the end of the
buffer.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays._checks import Integers, Layer, Size


@dataclass(frozen=True)
class BufferRegion:
    """A rectangle of the buffer.

    Attributes:
        start_index: first row and column, buffer indices.
        size: rows and columns.
    """

    start_index: Size
    size: Size

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of the region in a layer: `layer[region.slices]`."""
        (row, column), (rows, columns) = self.start_index, self.size
        return slice(row, row + rows), slice(column, column + columns)


def place(numbers: Integers, first: int, start: int, size: int) -> None:
    """Convert rows or columns of a block of the map to buffer indices, in place.

    Args:
        numbers: (N,) counted from `first`; the cells are on the map.
        first: row or column of the map where the block begins.
        start, size: start index and number of cells of the map along this axis.
    """
    numbers += first + start
    if start:
        # Either the number or the number minus `size` is on the map; unsigned, negatives are huge.
        unsigned = numbers.view(np.uint64)
        np.minimum(unsigned, (numbers - size).view(np.uint64), out=unsigned)


def block(
    layer: Layer, start: Size, rows: slice, columns: slice, out: Layer | None = None
) -> Layer:
    """Copy a block of map cells out of the buffer, in map order.

    Args:
        layer: (rows, cols) the whole buffer.
        start: start index of the circular buffer.
        rows, columns: the block, as cells of the map.
        out: array of the block's shape to copy into; None makes one.
    """
    if out is None:
        shape = rows.stop - rows.start, columns.stop - columns.start
        out = np.empty(shape, layer.dtype, "F")
    for from_rows, to_rows in _pieces(rows, start[0], layer.shape[0]):
        for from_columns, to_columns in _pieces(columns, start[1], layer.shape[1]):
            out[to_rows, to_columns] = layer[from_rows, from_columns]
    return out


def unwrapped(layer: Layer, start: Size, out: Layer | None = None) -> Layer:
    """Return a copy of a layer in map order: it begins with the cell at the start index.

    Args:
        layer: (rows, cols) as it is stored.
        start: start index, where cell (0, 0) of the map lies.
        out: array of the same shape to copy into; None makes one.
    """
    rows, columns = layer.shape
    return block(layer, start, slice(0, rows), slice(0, columns), out)


def uncovered(start: Size, size: Size, shift: Size) -> list[BufferRegion]:
    """Return the buffer regions that leave the map when it moves by `shift` cells.

    They hold the newly covered cells afterwards. At most two strips of rows come first, then at
    most two strips of columns; a shift by the whole map or more gives one region, the buffer.
    """
    if any(abs(step) >= cells for step, cells in zip(shift, size, strict=True)):
        return [BufferRegion((0, 0), size)]
    strips = [
        _runs(first if step > 0 else first + step, abs(step), cells)
        for first, step, cells in zip(start, shift, size, strict=True)
    ]
    rows = [BufferRegion((first, 0), (count, size[1])) for first, count in strips[0]]
    columns = [BufferRegion((0, first), (size[0], count)) for first, count in strips[1]]
    return rows + columns


def _pieces(cells: slice, start: int, size: int) -> Iterator[tuple[slice, slice]]:
    """Yield (buffer slice, block slice) of the one or two runs that cells take in the buffer."""
    done = 0
    for first, count in _runs(cells.start + start, cells.stop - cells.start, size):
        yield slice(first, first + count), slice(done, done + count)
        done += count


def _runs(first: int, count: int, size: int) -> Iterator[tuple[int, int]]:
    """Yield (first, count) of the runs of `count` lines of the buffer, which wrap at its end."""
    first %= size
    before_end = min(count, size - first)
    if before_end:
        yield first, before_end
    if before_end < count:
        yield 0, count - before_end
