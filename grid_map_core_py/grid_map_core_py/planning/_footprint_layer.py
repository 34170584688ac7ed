# SPDX-License-Identifier: BSD-3-Clause
"""Values under a footprint at every cell."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Literal, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer
from ..map._grid_map import GridMap
from ..plugins import check
from ._footprint import Footprint, kernel_of

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
    result = np.empty((*values.shape, yaws), np.float32, order="F")
    found = statistics_under(values, footprint, grid_map.resolution, yaws, statistic)
    for number, one in enumerate(found):
        result[..., number] = np.roll(one, grid_map.start_index, axis=(0, 1))
    return result


def check_directions(yaws: int, statistic: str) -> None:
    """Raise a `ConfigError` if an argument of `footprint_layer` is invalid."""
    is_count = isinstance(yaws, int | np.integer) and yaws >= 1
    check(is_count, "yaws", "a number of directions >= 1", yaws)
    known = get_args(Statistic)
    check(statistic in known, "statistic", " or ".join(map(repr, known)), statistic)


def statistics_under(
    values: Layer, footprint: Footprint, resolution: float, yaws: int, statistic: Statistic
) -> Iterator[Layer]:
    """Yield the layers of `footprint_layer` in map order, one for each direction."""
    unknown = np.ascontiguousarray(~np.isfinite(values).T)
    image = np.ascontiguousarray(np.where(unknown, np.float32(0.0), values.T))
    compute: Any = {"min": cv2.erode, "mean": _means, "max": cv2.dilate}[statistic]
    border: dict[str, Any] = {"borderType": cv2.BORDER_CONSTANT, "borderValue": 1}
    for number in range(yaws):
        kernel = kernel_of(footprint, resolution, 2.0 * math.pi * number / yaws)
        under = compute(image, kernel)
        under[cv2.dilate(unknown.view(np.uint8), kernel, **border) > 0] = np.nan
        yield under.T


def _means(image: NDArray[np.float32], kernel: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the means of the values under a kernel.

    Differences of running sums, or a Fourier transform, would be faster, but a huge value would
    spoil the means of cells far away from it.
    """
    margins = np.array(kernel.shape) // 2
    padded = np.pad(image.astype(np.float64), [(margin, margin) for margin in margins])
    edges = np.argwhere(np.diff(kernel, axis=1, prepend=0, append=0))
    begins, lengths = edges[::2], np.diff(edges[:, 1])[::2]
    total, sums = np.zeros(image.shape), padded
    for length in range(1, lengths.max(initial=0) + 1):
        for line, first in begins[lengths == length]:
            total += sums[line:, first:][: image.shape[0], : image.shape[1]]
        sums = sums[:, :-1] + padded[:, length:]
    return (total / np.count_nonzero(kernel)).astype(np.float32)
