# SPDX-License-Identifier: BSD-3-Clause
"""Medians of the finite values in square windows."""

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from grid_map_core_py._arrays import Layer, Mask, slices

Values = npt.NDArray[np.float32]

_SCATTERED = 0.3
"""Maximum fraction of chosen cells for which sorting single windows is fastest."""

_LARGEST_NETWORK = 5
"""Maximum window side for which a sorting network is faster than sorting single windows."""

_PIECE = 2**16
"""Number of values sorted at a time."""


def put_window_medians(output: Layer, layer: Layer, cells: Mask, half_width: int) -> None:
    """Write the upper median of the finite values in the square around each chosen cell.

    The upper median of an even number of values is the larger of the two middle values. The result
    is NaN where no value is finite.

    Args:
        output: (rows, cols) array in Fortran order, to which the medians are written.
        layer: (rows, cols) array in Fortran order.
        cells: (rows, cols) bool mask of the chosen cells, in Fortran order.
        half_width: squares have 2 half_width + 1 cells per side, and are cropped at the map border.
    """
    # Wider squares would contain no additional cells.
    half_width = min(half_width, max(layer.shape) - 1)
    side = 2 * half_width + 1
    # Missing values become infinity, which is sorted to the end.
    padded = np.full(np.add(layer.T.shape, 2 * half_width), np.inf, np.float32)
    inner = padded[half_width:, half_width:][: layer.shape[1], : layer.shape[0]]
    np.copyto(inner, layer.T, where=np.isfinite(layer.T))
    known = np.isfinite(padded).view(np.uint8)
    counts = cv2.boxFilter(known, cv2.CV_32S, (side, side), normalize=False)
    ranks = np.asarray(counts)[half_width:, half_width:][: inner.shape[0], : inner.shape[1]] // 2
    windows = sliding_window_view(padded, (side, side))
    if side <= _LARGEST_NETWORK and np.count_nonzero(cells) > _SCATTERED * cells.size:
        for lines in slices(len(ranks), _PIECE // 8 // ranks.shape[1]):
            medians = _medians_by_network(windows[lines], ranks[lines])
            np.copyto(output.T[lines], medians, where=cells.T[lines])
    else:
        rows, columns = np.divmod(np.flatnonzero(cells.T), len(cells))
        for piece in slices(rows.size, _PIECE // side**2):
            at = rows[piece], columns[piece]
            values = windows[at].reshape(-1, side**2)
            values.sort(axis=1)
            output.T[at] = values[np.arange(len(values)), ranks[at]]
    output[cells & np.isinf(output)] = np.nan


def _medians_by_network(windows: Values, ranks: npt.NDArray[Any]) -> Values:
    """Return the values with the given ranks (n, m) in the windows (n, m, side, side)."""
    values: list[Values] = [*np.moveaxis(windows, (2, 3), (0, 1)).copy().reshape(-1, *ranks.shape)]
    spare = np.empty_like(values[0])
    for low, high in _comparators(len(values)):
        np.minimum(values[low], values[high], out=spare)
        np.maximum(values[low], values[high], out=values[high])
        values[low], spare = spare, values[low]
    picked = values[0]
    for rank in range(1, int(ranks.max()) + 1):
        np.copyto(picked, values[rank], where=ranks == rank)
    return picked


def _comparators(count: int) -> Iterator[tuple[int, int]]:
    """Yield the comparators of Batcher's merge exchange (Knuth, TAOCP 3, algorithm 5.2.2M)."""
    largest = 1 << (count - 1).bit_length() >> 1
    step = largest
    while step:
        bound, remainder, distance = largest, 0, step
        while distance:
            yield from ((i, i + distance) for i in range(count - distance) if i & step == remainder)
            distance, bound, remainder = bound - step, bound >> 1, step
        step >>= 1
