# SPDX-License-Identifier: BSD-3-Clause
"""Values under a footprint at every cell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer, Size
from ..map import _ring_buffer as ring_buffer
from ..map._grid_map import GridMap
from ..plugins import check
from ._footprint import Footprint, Kernel, kernels_of

Statistic = Literal["min", "mean", "max"]


def footprint_layer(
    grid_map: GridMap,
    footprint: Footprint,
    layer: str,
    yaws: int = 16,
    statistic: Statistic = "min",
) -> NDArray[np.float32]:
    """Return a statistic of the values under the footprint, which stands at the center of a cell.

    Args:
        layer: layer with the values; cells that are not finite, and cells beyond the map, are
            unknown.
        yaws: number of directions; the yaw of direction k is 2 pi k / `yaws`.
        statistic: lowest value, mean or highest value of the cells that the footprint touches.

    Returns:
        (rows, cols, yaws) float32; rows and columns are ordered like the layers of the map. NaN if
        a cell under the footprint is unknown.

    Raises:
        LayerNotFoundError: the layer does not exist.
        ConfigError: `yaws` or `statistic` is invalid.
        LimitError: the footprint is larger than the largest permitted map.

    Example:
        >>> grid_map = GridMap((2.0, 2.0), 0.1, layers={"traversability": 1.0})
        >>> lowest = footprint_layer(grid_map, Footprint.circle(0.3), "traversability", yaws=1)
        >>> np.isfinite(lowest).sum(axis=0)[:, 0]
        array([ 0,  0,  0, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14, 14,
                0,  0,  0])
    """
    values = grid_map.unwrapped(layer)
    check_directions(yaws, statistic)
    rows, columns = values.shape
    result = np.empty((rows, columns, yaws), np.float32, order="F")
    copies = ring_buffer.copies(
        grid_map.start_index, (rows, columns), slice(0, rows), slice(0, columns)
    )
    for found, numbers in statistics_under(values, footprint, grid_map.resolution, yaws, statistic):
        for number in numbers:
            for target, source in copies:
                result[(*target, number)] = found[source]
    return result


def check_directions(yaws: int, statistic: str) -> None:
    """Raise a `ConfigError` if an argument of `footprint_layer` is invalid."""
    is_count = isinstance(yaws, int | np.integer) and yaws >= 1
    check(is_count, "yaws", "a number of directions >= 1", yaws)
    known = get_args(Statistic)
    check(statistic in known, "statistic", " or ".join(map(repr, known)), statistic)


def statistics_under(
    values: Layer, footprint: Footprint, resolution: float, yaws: int, statistic: Statistic
) -> Iterator[tuple[Layer, list[int]]]:
    """Yield the layers of `footprint_layer` in map order, each with the numbers of its directions.

    Directions in which the footprint touches the same cells share a layer.
    """
    directions = [2.0 * math.pi * number / yaws for number in range(yaws)]
    rows, columns = values.shape
    kernels, of_yaw = kernels_of(footprint, resolution, directions, (rows, columns))
    under = means_under if statistic == "mean" else extremes_under
    sign = np.float32(-1 if statistic == "max" else 1)
    for kernel, found in zip(kernels, under(sign * values, kernels), strict=True):
        if not kernel.is_whole:
            found[...] = np.nan
        yield sign * found, [place for place, used in enumerate(of_yaw) if kernels[used] is kernel]


def extremes_under(values: Layer, kernels: list[Kernel]) -> Iterator[Layer]:
    """Yield the lowest value under each kernel around every cell; NaN if a cell is unknown."""
    image = np.ascontiguousarray(np.where(np.isfinite(values), values, np.float32(-np.inf)).T)
    for element, _ in kernels:
        lowest = cv2.erode(image, element, borderType=cv2.BORDER_CONSTANT, borderValue=-np.inf)
        lowest[np.isneginf(lowest)] = np.nan
        yield np.asarray(lowest.T, np.float32)


def means_under(values: Layer, kernels: list[Kernel]) -> Iterator[Layer]:
    """Yield the mean under each kernel around every cell; NaN if a cell is unknown."""
    known = np.isfinite(values)
    unknown = np.ascontiguousarray(~known.T).view(np.uint8)
    margins = np.max([np.array(element.shape[::-1]) // 2 for element, _ in kernels], axis=0)
    sums = _Sums(np.where(known, values, 0.0), (int(margins[0]), int(margins[1])))
    for element, _ in kernels:
        mean = (sums.under(element) / np.count_nonzero(element)).astype(np.float32)
        mean[
            cv2.dilate(unknown, element, borderType=cv2.BORDER_CONSTANT, borderValue=1.0).T > 0
        ] = np.nan
        yield mean


class _Sums:
    """Sums of the values under kernels.

    Sums are never differences of running sums, so that a huge value affects the precision only
    where it is under the kernel. A line of cells is composed of lines whose lengths are powers of
    two.

    Args:
        values: (rows, cols), all finite.
        margins: largest number of rows and columns from the middle of a kernel to its end.
    """

    def __init__(self, values: NDArray[np.float64], margins: Size) -> None:
        padded = np.zeros(np.add(values.shape, np.multiply(2, margins)), order="F")
        self._size, self._margins = values.shape, margins
        padded[margins[0] :, margins[1] :][: values.shape[0], : values.shape[1]] = values
        # Element k holds the sums over the 2**k cells from each cell on.
        self._lines = [padded]

    def under(self, element: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Return the (rows, cols) sums under a kernel around every cell."""
        (rows, columns), (down, right) = self._size, self._margins
        total = np.zeros((rows, columns), order="F")
        middle, half = np.array(element.shape) // 2
        edges = np.diff(np.pad(element, ((0, 0), (1, 1))).astype(np.int8), axis=1)
        for (line, first), (_, stop) in zip(
            np.argwhere(edges == 1).tolist(), np.argwhere(edges == -1).tolist(), strict=True
        ):
            column = right + line - int(middle)
            while first < stop:
                power = (stop - first).bit_length() - 1
                row = down + first - int(half)
                total += self._sums(power)[row : row + rows, column : column + columns]
                first += 1 << power
        return total

    def _sums(self, power: int) -> NDArray[np.float64]:
        while len(self._lines) <= power:
            half, length = self._lines[-1], 1 << (len(self._lines) - 1)
            self._lines.append(half[:-length] + half[length:])
        return self._lines[power]
