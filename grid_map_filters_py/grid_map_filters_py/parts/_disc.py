# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Sums over the disc around every cell at once.

The disc is closed: a cell centre within 1e-9 m of the rim is inside. Beyond the border of the map
there is no data.

No sum is made by subtracting one running sum from another, so that a huge value spoils only the
discs that hold it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py.arrays import Layer, Size, slices
from grid_map_core_py.regions import BORDER_TOLERANCE, half_chords

Kernel = npt.NDArray[np.float64]
Flat = npt.NDArray[Any]
Lines = tuple[int, Flat, Flat]


@dataclass(frozen=True)
class Disc:
    """The cells within `radius` of a cell.

    Args:
        radius: [m].
        resolution: side of a cell [m].
        size: rows and columns of the map; the disc has no cells further apart than the map's.
    """

    radius: float
    resolution: float
    size: Size

    @cached_property
    def reach(self) -> Size:
        """Rows and columns from the center to the rim."""
        rows, columns = (int(min(self._limit, count - 1)) for count in self.size)
        return rows, columns

    @property
    def offsets(self) -> tuple[Kernel, Kernel]:
        """(n, 1) and (1, m) distances of rows and columns from the center, in cells."""
        rows, columns = (np.arange(-reach, reach + 1.0) for reach in self.reach)
        return rows[:, None], columns[None, :]

    @cached_property
    def half_widths(self) -> tuple[Flat, Flat]:
        """Cells from the middle to the end of lines along rows, and of lines along columns.

        The index is the distance of the line from the center, in cells.
        """
        rows, columns = (
            np.minimum(half_chords(self._limit, np.arange(other + 1.0)), reach).astype(int)
            for reach, other in (self.reach, self.reach[::-1])
        )
        return rows, columns

    @cached_property
    def kernel(self) -> Kernel:
        """(n, m) with 1 in the cells of the disc and 0 elsewhere; n and m are odd."""
        rows, columns = (np.abs(offsets) for offsets in self.offsets)
        kernel: Kernel = (rows <= self.half_widths[0][columns.astype(int)]).astype(np.float64)
        return kernel

    @property
    def _limit(self) -> float:
        return (self.radius + BORDER_TOLERANCE) / self.resolution


@dataclass(frozen=True)
class Tile:
    """A rectangle of cells and all that the discs around them cover.

    The values of a tile lie in a flat array, line after line. In it all cells have the same
    neighbour at the same distance: one slice, whatever the size of the tile, and no inner loops.

    Args:
        disc: around every cell.
        rows, columns: the rectangle.
    """

    disc: Disc
    rows: slice
    columns: slice

    @cached_property
    def strides(self) -> Size:
        """Distance in the flat array from a row and from a column to the next."""
        return 1, self.rows.stop - self.rows.start + 2 * self.disc.reach[0]

    @cached_property
    def count(self) -> int:
        """Length of a flat array of sums."""
        return int(self.columns.stop - self.columns.start) * self.strides[1]

    def finite(
        self, layer: Layer, offset: float, dtype: npt.DTypeLike = np.float64
    ) -> tuple[Flat, Flat]:
        """Return where a layer is finite, and its differences to `offset`, 0 where it is not.

        Args:
            layer: (rows, cols) of the whole map.
            offset: see `typical_value`.
            dtype: of the differences.

        Returns:
            flat bool and `dtype`.
        """
        values = self.cut(layer, dtype)
        known = np.isfinite(values)
        values -= offset
        np.copyto(values, 0.0, where=~known)
        return known, values

    def cut(self, layer: Layer, dtype: npt.DTypeLike) -> Flat:
        """Return the flat values of a layer, NaN beyond the border of the map."""
        around = [
            slice(cells.start - reach, cells.stop + reach)
            for cells, reach in zip((self.rows, self.columns), self.disc.reach, strict=True)
        ]
        on_map = [
            slice(max(cells.start, 0), min(cells.stop, length))
            for cells, length in zip(around, layer.shape, strict=True)
        ]
        rows, columns = (
            slice(there.start - cells.start, there.stop - cells.start)
            for there, cells in zip(on_map, around, strict=True)
        )
        (row_reach, column_reach), (_, stride) = self.disc.reach, self.strides
        flat = np.full(self.count + 2 * (column_reach * stride + row_reach), np.nan, dtype)
        lines = flat[: flat.size // stride * stride].reshape(-1, stride)
        lines[columns, rows] = layer[on_map[0], on_map[1]].T
        return flat

    def neighbours(self, values: Flat, rows: int = 0, columns: int = 0) -> Flat:
        """Return for every cell the one that lies so many rows and columns further, as flat view.

        Args:
            values: flat, including what is around the tile.
            rows, columns: within the reach of the disc; 0 gives the cells themselves.
        """
        (row_reach, column_reach), (_, stride) = self.disc.reach, self.strides
        first = row_reach + rows + (column_reach + columns) * stride
        return values[first : first + self.count]

    def cells(self, sums: Flat) -> npt.NDArray[Any]:
        """Return the (rows, cols) view of flat sums that holds those of the cells of the tile."""
        return sums.reshape(-1, self.strides[1]).T[: self.rows.stop - self.rows.start]

    def lines(self, values: Flat, axis: int, *, moments: bool = False) -> Iterator[Lines]:
        """Yield sums over the lines that the discs consist of, from the rim to the centre.

        Args:
            values: flat.
            axis: along which the lines run, 0 for rows.
            moments: sum up the values times their distance from the middle of the line instead.

        Yields:
            A distance of lines from the centre in cells, flat sums over the lines at this distance
            on the positive and on the negative side, which are the same for the distance 0. The
            sums are to be used at once: the arrays are written into afterwards.
        """
        along, across = self.strides[axis], self.strides[1 - axis]
        widths = self.disc.half_widths[axis]
        margin, first = along * self.disc.reach[axis], across * (len(widths) - 1)
        inner = values[margin : values.size - margin]
        line = np.zeros_like(inner) if moments else inner.copy()
        width = 0
        for distance in reversed(range(len(widths))):
            # Towards the centre lines get longer, and begin as those before them.
            for width in range(width + 1, widths[distance] + 1):  # noqa: B020
                ahead = values[margin + width * along :][: line.size]
                behind = values[margin - width * along :][: line.size]
                if moments:
                    line += width * (ahead - behind)
                else:
                    line += ahead
                    line += behind
            shift = distance * across
            yield distance, line[first + shift :][: self.count], line[first - shift :][: self.count]

    def sums(self, values: Flat) -> Flat:
        """Return the flat sums of flat values over the discs."""
        total = np.zeros(self.count, values.dtype)
        for distance, ahead, behind in self.lines(values, 0):
            total += ahead
            if distance:
                total += behind
        return total

    def counts(self, known: Flat) -> Flat:
        """Return how many values in the disc around every cell are True, as flat integers."""
        # The smallest type is by far the fastest.
        smallest = np.min_scalar_type(np.count_nonzero(self.disc.kernel))
        return self.sums(known.view(np.uint8).astype(smallest, copy=False))


def tiles(disc: Disc, side: int = 256) -> Iterator[Tile]:
    """Yield the tiles of a map.

    Args:
        disc: around every cell.
        side: of a tile at most, in cells. The arrays of a tile should stay in the cache of one
            core; larger tiles overlap less, by what lies within reach of two.
    """
    # Or with large discs too much would be computed twice.
    side = max(side, 8 * max(disc.reach))
    for rows, columns in product(*(_even_parts(length, side) for length in disc.size)):
        yield Tile(disc, rows, columns)


def _even_parts(length: int, longest: int) -> Iterator[slice]:
    return slices(length, math.ceil(length / math.ceil(length / longest)))


def typical_value(layer: Layer) -> float:
    """Return about the median of the finite values, 0 if there are none.

    Sums of differences to it keep their precision on a layer that lies 1000 m up, whatever
    outliers it has.
    """
    flat = layer.ravel("K")
    sample = flat[:: flat.size // 1000 + 1]
    known = sample[np.isfinite(sample)]
    if not known.size:
        known = flat[np.isfinite(flat)]
    # In single precision the mean of two huge numbers would be infinite.
    return float(np.median(known.astype(np.float64))) if known.size else 0.0
