# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Medians of the finite values in square windows.

They are exact: values are only compared. Windows are gathered and sorted, but where medians of most
cells are wanted, small windows go through a sorting network, which is two to five times as fast.
"""

import math
from collections.abc import Iterator

import cv2
import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from grid_map_core_py.arrays import Layer, Mask, slices

Values = npt.NDArray[np.float32]
Ranks = npt.NDArray[np.int32]

_SCATTERED = 0.3
"""Share of all cells up to which sorting single windows is fastest."""

_LARGEST_NETWORK = 25
"""Values of a window up to which a network is faster than sorting."""

_PIECE = 2**16
"""Values that are sorted at a time."""

_NETWORK_PIECE = 2**13
"""Cells that the network sorts at a time."""


def put_window_medians(output: Layer, layer: Layer, cells: Mask, half_width: int) -> None:
    """Write the upper median of the finite values in the square around each chosen cell.

    The upper median of an even number of values is the larger one of the two in the middle. It is
    NaN where no value is finite.

    Args:
        output: (rows, cols) in Fortran order; is written to.
        layer: (rows, cols) in Fortran order.
        cells: (rows, cols) bool in Fortran order; the chosen cells.
        half_width: the square has 2 half_width + 1 cells along a side; it is cropped at the border.
    """
    # Wider squares contain no further cells.
    half_width = min(half_width, max(layer.shape) - 1)
    side = 2 * half_width + 1
    padded, known = _padded(layer.T, half_width), np.isfinite(layer.T).view(np.uint8)
    counts = cv2.boxFilter(
        known, cv2.CV_32S, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    # The rank of the upper median among the sorted values of each window.
    ranks = np.right_shift(counts, 1, out=counts)
    windows = sliding_window_view(padded, (side, side))
    if side * side > _LARGEST_NETWORK or np.count_nonzero(cells) <= _SCATTERED * cells.size:
        _put_medians_of_single_windows(output.T, windows, ranks, cells.T)
    else:
        medians = _without_infinity(_medians_by_network(windows, ranks))
        cv2.copyTo(medians, cells.T.view(np.uint8), output.T)


def _without_infinity(medians: Values) -> Values:
    missing = np.isinf(medians)
    if missing.any():
        medians[missing] = np.nan
    return medians


def _padded(values: Values, half_width: int) -> Values:
    """Return padded values; missing ones are infinity, which sorts to the end."""
    margins = (half_width,) * 4
    padded = cv2.copyMakeBorder(values, *margins, cv2.BORDER_CONSTANT, value=np.inf)
    cv2.patchNaNs(padded, np.inf)
    if cv2.minMaxLoc(padded)[0] == -np.inf:
        padded[np.isneginf(padded)] = np.inf
    return np.asarray(padded, dtype=np.float32)


def _put_medians_of_single_windows(
    output: Values, windows: Values, ranks: Ranks, cells: Mask
) -> None:
    size = math.prod(windows.shape[2:])
    rows, columns = np.divmod(np.flatnonzero(cells), cells.shape[1])
    for piece in slices(rows.size, _PIECE // size):
        at = rows[piece], columns[piece]
        values = windows[at].reshape(-1, size)
        values.sort(axis=1)
        output[at] = _without_infinity(values[np.arange(len(values)), ranks[at]])


def _medians_by_network(windows: Values, ranks: Ranks) -> Values:
    medians = np.empty(ranks.shape, np.float32)
    windows = np.moveaxis(windows, (2, 3), (0, 1))
    for lines in slices(len(ranks), _NETWORK_PIECE // ranks.shape[1]):
        values = windows[:, :, lines].copy().reshape(math.prod(windows.shape[:2]), -1)
        rows, flat_ranks = _sorted(values), ranks[lines].ravel()
        picked = np.empty_like(rows[0])
        for rank in range(int(flat_ranks.min()), int(flat_ranks.max()) + 1):
            np.copyto(picked, rows[rank], where=flat_ranks == rank)
        medians[lines] = picked.reshape(medians[lines].shape)
    return medians


def _sorted(values: Values) -> list[Values]:
    """Return the rows of an array (n, m), sorted within each column; overwrites the array."""
    rows = list(values)
    spare = np.empty_like(rows[0])
    for low, high in _comparators(len(rows)):
        np.minimum(rows[low], rows[high], out=spare)
        np.maximum(rows[low], rows[high], out=rows[high])
        rows[low], spare = spare, rows[low]
    return rows


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
