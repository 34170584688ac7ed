# SPDX-License-Identifier: BSD-3-Clause
"""Sums over the disc around every cell at once.

The disc is closed: a cell center within 1e-9 m of the rim is inside. Beyond the border of the map
there is no data.

Sums are never differences of running sums (as in an integral image), so that a huge value spoils
only the discs that contain it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, Size, slices
from grid_map_core_py.regions import BORDER_TOLERANCE, half_chords

from .._filter import WHOLE_MAP

Kernel = npt.NDArray[np.float64]
Flat = npt.NDArray[Any]
Lines = tuple[int, Flat, Flat]

_LARGEST = 2**31
"""Cells along a side that no map has."""


def disc_reach(radius: float, resolution: float) -> float:
    """Return the whole cells from the center of a disc to its rim, for `reach` of a filter.

    Args:
        radius: [m]; less than 0 counts as 0.
        resolution: side of a cell [m].

    Returns:
        A number of cells; `WHOLE_MAP` for a disc that no map can hold.
    """
    cells = (max(radius, 0.0) + BORDER_TOLERANCE) / resolution
    return math.floor(cells) if cells < _LARGEST else WHOLE_MAP


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
    """A rectangle of cells with the margin that the discs around them cover.

    The values of a tile are in a flat array, column after column. There the neighbors of all cells
    at one distance are a single slice, so that no loop over rows is needed.

    Args:
        disc: around every cell.
        rows, columns: the rectangle.
    """

    disc: Disc
    rows: slice
    columns: slice

    @cached_property
    def strides(self) -> Size:
        """Steps in the flat array from one row to the next, and from one column to the next."""
        return 1, self.rows.stop - self.rows.start + 2 * self.disc.reach[0]

    @cached_property
    def count(self) -> int:
        """Length of a flat array of sums."""
        return int(self.columns.stop - self.columns.start) * self.strides[1]

    def finite(
        self, layer: Layer, offset: float, dtype: npt.DTypeLike = np.float64
    ) -> tuple[Flat, Flat]:
        """Return a mask of the finite cells, and their differences to `offset`.

        Args:
            layer: (rows, cols) of the whole map.
            offset: see `typical_value`.
            dtype: type of the differences.

        Returns:
            finite: flat bool.
            differences: flat `dtype`, 0 in cells that are not finite.
        """
        values = self.cut(layer, dtype)
        known = np.isfinite(values)
        values -= offset
        np.copyto(values, 0.0, where=~known)
        return known, values

    def cut(self, layer: Layer, dtype: npt.DTypeLike) -> Flat:
        """Return the flat values of a layer; NaN outside of the map."""
        on_map, on_tile = [], []
        for cells, reach, length in zip(
            (self.rows, self.columns), self.disc.reach, layer.shape, strict=True
        ):
            first, last = max(cells.start - reach, 0), min(cells.stop + reach, length)
            on_map.append(slice(first, last))
            on_tile.append(slice(first - cells.start + reach, last - cells.start + reach))
        (row_reach, column_reach), (_, stride) = self.disc.reach, self.strides
        flat = np.full(self.count + 2 * (column_reach * stride + row_reach), np.nan, dtype)
        lines = flat[: flat.size // stride * stride].reshape(-1, stride)
        lines.T[tuple(on_tile)] = layer[tuple(on_map)]
        return flat

    def neighbors(self, values: Flat, rows: int = 0, columns: int = 0) -> Flat:
        """Return a flat view of the neighbors of all cells at a distance.

        Args:
            values: flat, with the margin of the tile.
            rows, columns: distance, within the reach of the disc; 0 gives the cells themselves.
        """
        (row_reach, column_reach), (_, stride) = self.disc.reach, self.strides
        first = row_reach + rows + (column_reach + columns) * stride
        return values[first : first + self.count]

    def cells(self, sums: Flat) -> npt.NDArray[Any]:
        """Return the sums of the cells of the tile, a (rows, cols) view of flat sums."""
        return sums.reshape(-1, self.strides[1]).T[: self.rows.stop - self.rows.start]

    def lines(self, values: Flat, axis: int, *, moments: bool = False) -> Iterator[Lines]:
        """Yield sums over the lines of the discs, from the rim to the center.

        Args:
            values: flat, with the margin of the tile.
            axis: direction of the lines, 0 for rows.
            moments: sum up the values times their distance from the middle of the line instead.

        Yields:
            distance: distance of the line from the center [cells].
            ahead, behind: flat sums over the lines at this distance on both sides of the center;
                the same for distance 0. The next step overwrites them.
        """
        along, across = self.strides[axis], self.strides[1 - axis]
        widths = self.disc.half_widths[axis]
        margin, first = along * self.disc.reach[axis], across * (len(widths) - 1)
        inner = values[margin : values.size - margin]
        line = np.zeros_like(inner) if moments else inner.copy()
        width = 0
        for distance in reversed(range(len(widths))):
            # Lines get longer towards the center, so only their new ends are added.
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
        """Return the number of True values in the disc around every cell, as flat integers."""
        # The smallest integer type is by far the fastest.
        smallest = np.min_scalar_type(np.count_nonzero(self.disc.kernel))
        return self.sums(known.view(np.uint8).astype(smallest, copy=False))


def tiles(disc: Disc, side: int = 512) -> Iterator[Tile]:
    """Yield the tiles of a map.

    Args:
        disc: around every cell.
        side: maximum side of a tile [cells]. The arrays of a tile should fit the cache of one core;
            the margins of larger tiles overlap less.
    """
    # With large discs, margins of small tiles would dominate the computation time.
    side = max(side, 8 * max(disc.reach))
    lengths = [math.ceil(length / math.ceil(length / side)) for length in disc.size]
    for rows, columns in product(*map(slices, disc.size, lengths)):
        yield Tile(disc, rows, columns)


def typical_value(layer: Layer) -> float:
    """Return the approximate median of the finite values, 0 if there are none.

    Sums of differences to it keep their precision on terrain at 1000 m, also with outliers.
    """
    flat = layer.ravel("K")
    sample = flat[:: flat.size // 1000 + 1]
    known = sample[np.isfinite(sample)]
    if not known.size:
        known = flat[np.isfinite(flat)]
    # Double precision, so that the mean of two huge numbers stays finite.
    return float(np.median(known.astype(np.float64))) if known.size else 0.0
