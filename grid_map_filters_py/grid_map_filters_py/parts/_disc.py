# SPDX-License-Identifier: BSD-3-Clause
"""Sums over the disc around every cell.

A disc contains the cells whose centers are inside, on the edge, or at most 1e-9 m beyond the edge.
Cells outside the map count as missing.

A huge value reduces the precision only in discs that contain it, unlike in an integral image.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, Size
from grid_map_core_py.map._axis import BORDER_TOLERANCE
from grid_map_core_py.regions._shapes import half_chords

from .._filter import WHOLE_MAP, warn

Field = npt.NDArray[Any]

_LARGEST = 2**31
"""Radius from which a disc counts as larger than any map [cells]."""


def disc_reach(radius: float, resolution: float) -> float:
    """Return the radius of a disc in whole cells, for the `reach` of a filter.

    Args:
        radius: radius [m]; negative values count as 0.
        resolution: side of a cell [m].

    Returns:
        A number of cells, or `WHOLE_MAP` if the disc is larger than any map.
    """
    cells = (max(radius, 0.0) + BORDER_TOLERANCE) / resolution
    return math.floor(cells) if cells < _LARGEST else WHOLE_MAP


def need_neighbors(radius: float, resolution: float) -> None:
    """Warn if a disc contains only the cell at its center."""
    if disc_reach(radius, resolution) < 1:
        text = f"radius: expected at least one cell, {resolution:g} m, got {radius:g} m"
        warn(f"{text}. A disc without neighboring cells gives no useful result")


@dataclass(frozen=True)
class Disc:
    """Disc of a given radius; computes sums over the disc around every cell of a layer.

    Args:
        radius: radius of the disc [m].
        resolution: side of a cell [m].
        size: rows and columns of the layer, to which the disc is limited.

    Example:
        >>> layer = np.eye(5, dtype=np.float32)
        >>> disc = Disc(0.1, 0.1, layer.shape)
        >>> known, values = disc.padded(layer)
        >>> disc.sums(values)[2]
        array([0., 2., 1., 2., 0.])
    """

    radius: float
    resolution: float
    size: Size

    @cached_property
    def reach(self) -> Size:
        """Number of rows and columns from the center to the edge."""
        rows, columns = (int(min(self._limit, count - 1)) for count in self.size)
        return rows, columns

    @property
    def offsets(self) -> tuple[Field, Field]:
        """Signed row offsets (n, 1) and column offsets (1, m) from the center [cells]."""
        rows, columns = (np.arange(-reach, reach + 1.0) for reach in self.reach)
        return rows[:, None], columns[None, :]

    @cached_property
    def half_widths(self) -> tuple[Field, Field]:
        """Half-lengths of the chords i cells from the center [cells], along axis 0 and axis 1."""
        rows, columns = (
            np.minimum(half_chords(self._limit, np.arange(other + 1.0)), reach).astype(int)
            for reach, other in (self.reach, self.reach[::-1])
        )
        return rows, columns

    @cached_property
    def kernel(self) -> Field:
        """Array (n, m) that is 1 in the cells of the disc and 0 elsewhere; n and m are odd."""
        rows, columns = (np.abs(offsets) for offsets in self.offsets)
        return np.asarray(rows <= self.half_widths[0][columns.astype(int)], np.float64)

    @property
    def _limit(self) -> float:
        return (self.radius + BORDER_TOLERANCE) / self.resolution

    def padded(
        self, layer: Layer, offset: float = 0.0, dtype: npt.DTypeLike = np.float64
    ) -> tuple[Field, Field]:
        """Pad a layer by the reach of the disc, and separate missing cells from values.

        Args:
            layer: (rows, columns) array of the size passed to `Disc`.
            offset: number subtracted from all values; see `typical_value`.
            dtype: type of the differences.

        Returns:
            known: padded bool mask of the finite cells.
            values: padded differences from `offset`; 0 in non-finite cells.
        """
        rows, columns = self.reach
        values = np.zeros(np.add(self.size, (2 * rows, 2 * columns)), dtype, order="F")
        known = np.zeros(values.shape, np.bool_, order="F")
        finite = np.isfinite(layer, out=known[self.inner])
        differences = np.subtract(layer, offset, out=values[self.inner], dtype=dtype)
        # This is three times as fast as the argument `where` of `subtract`.
        np.copyto(differences, 0.0, where=~finite)
        return known, values

    @property
    def inner(self) -> tuple[slice, slice]:
        """Slices of the layer within a padded array."""
        (rows, columns), (height, width) = self.reach, self.size
        return slice(rows, rows + height), slice(columns, columns + width)

    def sums_of_lines(
        self, values: Field, axis: int, *, moments: bool = False
    ) -> Iterator[tuple[int, Field, Field]]:
        """Yield sums over the lines of cells that make up the disc around every cell.

        Args:
            values: array returned by `padded`.
            axis: array axis along which the lines run. A disc has one line at its center, and two
                lines at any other distance from the center.
            moments: whether to weight values by their signed distance from the middle of the line.

        Yields:
            distance: distance of the lines from the center [cells], in decreasing order down to 0.
            ahead: for every cell, sum over the line at `distance` towards higher indices. The array
                is laid out like the flat array of `totals`; the next iteration overwrites it.
            behind: the same towards lower indices; equal to `ahead` if `distance` is 0.
        """
        # In a flat array, one slice contains the neighbors of all cells at a given offset.
        flat, strides = values.T.reshape(-1), (1, len(values))
        along, across = strides[axis], strides[1 - axis]
        widths, margin = self.half_widths[axis], along * self.reach[axis]
        middle = flat[margin : flat.size - margin]
        line = np.zeros_like(middle) if moments else middle.copy()
        length = line.size - 2 * across * self.reach[1 - axis]
        width = 0
        for distance in reversed(range(len(widths))):
            # Lines get longer towards the center, so only the new ends are added.
            for width in range(width + 1, widths[distance] + 1):  # noqa: B020
                ahead = flat[margin + width * along :][: line.size]
                behind = flat[margin - width * along :][: line.size]
                if moments:
                    line += width * (ahead - behind)
                else:
                    line += ahead
                    line += behind
            first, shift = across * self.reach[1 - axis], across * distance
            yield distance, line[first + shift :][:length], line[first - shift :][:length]

    def totals(self, dtype: npt.DTypeLike) -> tuple[Field, Field]:
        """Return a zeroed (rows, columns) array for sums, and a flat view of it.

        Like the sums of `sums_of_lines`, the flat view includes the padding between columns.
        """
        (height, width), (rows, _) = self.size, self.reach
        stride = height + 2 * rows
        flat = np.zeros(width * stride, dtype)
        return flat.reshape(width, stride).T[:height], flat[: flat.size - 2 * rows]

    def sums(self, values: Field) -> Field:
        """Return the (rows, columns) sums of the padded `values` over all discs."""
        total, flat = self.totals(values.dtype)
        for distance, ahead, behind in self.sums_of_lines(values, 0):
            flat += ahead
            if distance:
                flat += behind
        return total

    def counts(self, known: Field) -> Field:
        """Count the True values of a padded mask in the disc around every cell."""
        # The smallest sufficient integer type is by far the fastest.
        smallest = np.min_scalar_type(np.count_nonzero(self.kernel))
        return self.sums(known.view(np.uint8).astype(smallest, copy=False))


def typical_value(layer: Layer) -> float:
    """Return the approximate median of the finite values; 0 if there are none.

    Subtract this value to preserve the precision of sums at large heights and with outliers.
    """
    flat = layer.ravel("K")
    sample = flat[:: flat.size // 1000 + 1]
    known = sample[np.isfinite(sample)]
    if not known.size:
        known = flat[np.isfinite(flat)]
    # In double precision, the mean of two huge values is finite.
    return float(np.median(known.astype(np.float64))) if known.size else 0.0
