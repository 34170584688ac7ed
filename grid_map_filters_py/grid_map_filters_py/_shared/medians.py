# SPDX-License-Identifier: BSD-3-Clause
"""Medians of the finite values in square windows.

They are exact: values are only compared. Windows are gathered and sorted, but where medians of most
cells are wanted, two ways are up to five times as fast: small windows go through a sorting network,
and large windows of neighbors sort what they share only once. Where numba is installed, compiled
loops take less than half of that time.
"""

from collections.abc import Callable, Iterator
from itertools import product
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from grid_map_core_py._arrays import Layer, Mask, slices
from grid_map_core_py._loops import Compiled

from .median_loops import LANES, slide_sets, sort_by_network

Values = npt.NDArray[np.float32]
Ranks = npt.NDArray[np.int32]

_SCATTERED = 0.3
"""Share of all cells up to which sorting single windows is fastest."""

_LARGEST_NETWORK = 5
"""Side of a window up to which a network is faster than sorting."""

_LARGEST_SINGLE = 11
"""Side of a window up to which sorting single windows is faster than sharing."""

_LARGEST_COMPILED_NETWORK = 7
"""Side of a window up to which a compiled network is faster than sets."""

_LARGEST_SET = 1025
"""Side of a window up to which sets of all values around a block need little memory."""

_BLOCK = 64
"""Least side of a block of windows whose values are sorted together."""

_SIGN, _LOWER = np.uint32(1 << 31), np.uint64(0xFFFFFFFF)

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
    padded, wanted = _padded(layer.T, half_width), cells.T
    is_scattered = np.count_nonzero(cells) <= _SCATTERED * cells.size
    median = None if is_scattered else _way_for(side)
    if median is None:
        _put_medians_of_single_windows(output.T, padded, side, wanted)
        return
    medians = median(padded, side)[: len(wanted), : wanted.shape[1]]
    cv2.copyTo(_without_infinity(medians), wanted.view(np.uint8), output.T)


def prepare_medians() -> tuple[Compiled, ...]:
    """Return the compiled loops, from disk or compiled now; none where there is no compiler."""
    network, sets = sort_by_network.compiled(), slide_sets.compiled()
    return (network, sets) if network and sets else ()


def _way_for(side: int) -> Callable[[Values, int], Values] | None:
    """Return the fastest way to medians of all windows; None means to sort single windows."""
    if side <= _LARGEST_SET and prepare_medians():
        is_small = side <= _LARGEST_COMPILED_NETWORK
        return _medians_by_compiled_network if is_small else _medians_by_sets
    if side <= _LARGEST_NETWORK:
        return _medians_by_network
    return None if side <= _LARGEST_SINGLE else _medians_of_large_windows


def _without_infinity(medians: Values) -> Values:
    missing = np.isinf(medians)
    if missing.any():
        medians[missing] = np.nan
    return medians


def _padded(values: Values, half_width: int) -> Values:
    """Return padded values; missing ones are infinity, which sorts to the end."""
    margins = (half_width,) * 4
    padded = cv2.copyMakeBorder(values, *margins, cv2.BORDER_CONSTANT, value=np.inf)
    # Sorting leaves the order of 0 and -0 open. This makes -0 a 0.
    padded = np.add(padded, np.float32(0), out=padded)
    cv2.patchNaNs(padded, np.inf)
    if cv2.minMaxLoc(padded)[0] == -np.inf:
        padded[np.isneginf(padded)] = np.inf
    return np.asarray(padded, dtype=np.float32)


def _ranks(weights: npt.NDArray[Any], side: int) -> Ranks:
    """Return half the sums of the weights in the windows, which are inside of the array."""
    sums = np.asarray(
        cv2.boxFilter(weights.view(np.uint8), cv2.CV_32S, (side, side), normalize=False), np.int32
    )
    inner = slice(side // 2, -(side // 2) or None)
    return np.right_shift(sums, 1, out=sums)[inner, inner]


def _put_medians_of_single_windows(output: Values, padded: Values, side: int, cells: Mask) -> None:
    # The rank of the upper median among the sorted values of each window.
    ranks, windows = _ranks(np.isfinite(padded), side), sliding_window_view(padded, (side, side))
    rows, columns = np.divmod(np.flatnonzero(cells), cells.shape[1])
    for piece in slices(rows.size, _PIECE // side**2):
        at = rows[piece], columns[piece]
        values = windows[at].reshape(-1, side**2)
        values.sort(axis=1)
        output[at] = _without_infinity(values[np.arange(len(values)), ranks[at]])


def _medians_by_network(padded: Values, side: int) -> Values:
    ranks = _ranks(np.isfinite(padded), side)
    medians = np.empty(ranks.shape, np.float32)
    windows = np.moveaxis(sliding_window_view(padded, (side, side)), (2, 3), (0, 1))
    for lines in slices(len(ranks), _NETWORK_PIECE // ranks.shape[1]):
        values = windows[:, :, lines].copy().reshape(side**2, -1)
        rows, flat_ranks = _sorted(values), ranks[lines].ravel()
        picked = np.empty_like(rows[0])
        for rank in range(int(flat_ranks.min()), int(flat_ranks.max()) + 1):
            np.copyto(picked, rows[rank], where=flat_ranks == rank)
        medians[lines] = picked.reshape(medians[lines].shape)
    return medians


def _medians_by_compiled_network(padded: Values, side: int) -> Values:
    sort, _ = prepare_medians()
    ranks = np.ascontiguousarray(_ranks(np.isfinite(padded), side))
    medians, lanes = np.empty(ranks.shape, np.float32), np.empty(side**2 * LANES, np.float32)
    pairs = np.array([*_comparators(side**2)], np.int32)
    sort(padded, padded.shape[1], len(ranks), side, ranks, pairs, len(pairs), lanes, medians)
    return medians


def _medians_by_sets(padded: Values, side: int) -> Values:
    _, slide = prepare_medians()
    ranks, margin = _ranks(np.isfinite(padded), side), side - 1
    medians, block = np.empty(ranks.shape, np.float32), max(_BLOCK, side)
    for y, x in product(*(slices(length, block) for length in ranks.shape)):
        around = padded[y.start : y.stop + margin, x.start : x.stop + margin]
        values, inner = around.ravel(), np.ascontiguousarray(ranks[y, x])
        keys, found = _sorted_keys(values), np.empty(inner.shape, np.float32)
        places, words = np.empty(keys.size, np.int32), np.empty(keys.size // 64 + 1, np.uint64)
        values = values[keys & _LOWER]
        slide(keys, around.shape[1], len(inner), side, inner, places, values, words, found)
        medians[y, x] = found
    return medians


def _sorted_keys(values: Values) -> npt.NDArray[np.uint64]:
    """Return sorted keys: integers that sort like the values, above the places of the values."""
    bits = values.view(np.uint32)
    keys = np.where(bits & _SIGN, ~bits, bits | _SIGN).astype(np.uint64)
    keys <<= np.uint64(32)
    keys |= np.arange(values.size, dtype=np.uint64)
    keys.sort()
    return keys


def _medians_of_large_windows(padded: Values, side: int) -> Values:
    """Sort the square that the windows of 2 x 2 cells share, then each with one row and column.

    Of the square, only values of middle rank can be medians. There are few if half of the missing
    values sort to the front, so that all medians have about the same rank.

    Returns:
        An array with even numbers of rows and columns; the last ones may have no meaning.
    """
    padded = np.pad(padded, (0, 1), constant_values=np.inf)
    in_front = np.isinf(padded)
    in_front[::2, ::2] = in_front[1::2, 1::2] = False
    ranks = _ranks(np.isfinite(padded) + 2 * in_front.view(np.uint8), side)
    padded[in_front] = -np.inf
    height, width = len(ranks) // 2, ranks.shape[1] // 2
    medians = np.empty((2 * height, 2 * width), np.float32)
    rows = sliding_window_view(padded, side, axis=1)
    columns = sliding_window_view(padded[1:], side - 1, axis=0)
    shared = sliding_window_view(padded[1:, 1:], (side - 1, side - 1))[::2, ::2]
    count = _PIECE // side**2
    for block in product(slices(height, count // width), slices(width, count)):
        middle = shared[block].reshape(-1, (side - 1) ** 2)
        middle.sort(axis=1)
        for i, j in product((0, 1), repeat=2):
            y, x = (slice(2 * part.start, 2 * part.stop, 2) for part in block)
            at = _shifted(y, i), _shifted(x, j)
            rank = ranks[at].ravel()
            lowest = max(int(rank.min()) - (2 * side - 1), 0)
            near = middle[:, lowest : int(rank.max()) + 1]
            parts = near, rows[_shifted(y, i * side), at[1]], columns[y, _shifted(x, j * side)]
            values = np.concatenate([part.reshape(rank.size, -1) for part in parts], axis=1)
            values.sort(axis=1)
            medians[at] = values[np.arange(rank.size), rank - lowest].reshape(medians[at].shape)
    return medians


def _shifted(part: slice, by: int) -> slice:
    return slice(part.start + by, part.stop + by, part.step)


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
