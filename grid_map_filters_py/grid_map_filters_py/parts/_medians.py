# SPDX-License-Identifier: BSD-3-Clause
"""Medians of the finite values in square windows."""

from itertools import product
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from grid_map_core_py._arrays import Layer, Mask, slices
from grid_map_core_py._loops import loop

Values = npt.NDArray[np.float32]

_SCATTERED = 0.3
"""Maximum fraction of chosen cells for which sorting single windows is faster than sliding."""

_LARGEST_NETWORK = 5
"""Maximum window side for which a sorting network is faster than sliding or sorting."""

_SIDE = 64
"""Minimum number of rows and columns of a block over which a window slides."""

_BUCKET = 16
"""Number of values in a bucket of `_slide`."""

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
    is_scattered = np.count_nonzero(cells) <= _SCATTERED * cells.size
    slide = None if is_scattered or side <= _LARGEST_NETWORK else _slide.compiled()
    if side <= _LARGEST_NETWORK and not is_scattered:
        for lines in slices(len(ranks), _PIECE // 8 // ranks.shape[1]):
            medians = _medians_by_network(windows[lines], ranks[lines])
            np.copyto(output.T[lines], medians, where=cells.T[lines])
    elif slide is not None:
        length = max(_SIDE, side)
        for block in product(*(slices(count, length) for count in ranks.shape)):
            around = padded[tuple(slice(part.start, part.stop + side - 1) for part in block)]
            order = np.argsort(around, axis=None)
            places = np.empty_like(order)
            places[order] = np.arange(order.size)
            found = ranks[block].astype(np.int64)
            buckets = np.empty(order.size // _BUCKET + 1, np.int64)
            slide(places, (*found.shape, side), np.empty(order.size, np.uint8), buckets, found)
            medians = around.ravel()[order][found]
            np.copyto(output.T[block], medians, where=cells.T[block])
    else:
        rows, columns = np.divmod(np.flatnonzero(cells.T), len(cells))
        for piece in slices(rows.size, _PIECE // side**2):
            at = rows[piece], columns[piece]
            values = windows[at].reshape(-1, side**2)
            values.sort(axis=1)
            output.T[at] = values[np.arange(len(values)), ranks[at]]
    output[cells & np.isinf(output)] = np.nan


@loop("int64*", ("int64", 3), "uint8*", "int64*", "int64*")
def _slide(places: Any, shape: Any, used: Any, in_buckets: Any, found: Any) -> None:
    """Replace the rank of each window's median by the place of the median in sorted order.

    From one window to the next, one column of values leaves and one enters, and the median moves
    by a few places (J. Suomela, "Median Filtering is Equivalent to Sorting", 2014).

    Args:
        places: places in sorted order of the values in and around a block.
        shape: rows and columns of the block, and side of the windows.
        used: memory for 1 if the value at a place is in the window.
        in_buckets: memory for the number of values in the window, by bucket of places.
        found: (rows, columns) ranks of the medians on entry, places on return.
    """
    rows, columns, side = shape
    for row in range(rows):
        used[:] = 0
        in_buckets[:] = 0
        # `before` is the number of values in the window that are in the buckets before `bucket`.
        bucket, before = 0, 0
        for column in range(columns):
            for y in range(row, row + side):
                start = y * (columns + side - 1) + column
                if column > 0:
                    place = places[start - 1]
                    used[place] = 0
                    in_buckets[place // _BUCKET] -= 1
                    before -= place // _BUCKET < bucket
                for x in range(side - 1 if column > 0 else 0, side):
                    place = places[start + x]
                    used[place] = 1
                    in_buckets[place // _BUCKET] += 1
                    before += place // _BUCKET < bucket
            rank = found[row * columns + column]
            while before > rank:
                bucket -= 1
                before -= in_buckets[bucket]
            while before + in_buckets[bucket] <= rank:
                before += in_buckets[bucket]
                bucket += 1
            place = bucket * _BUCKET
            left = rank - before
            while left >= used[place]:
                left -= used[place]
                place += 1
            found[row * columns + column] = place


def _medians_by_network(windows: Values, ranks: npt.NDArray[Any]) -> Values:
    """Return the values with the given ranks (n, m) in the windows (n, m, side, side)."""
    values: list[Values] = [*np.moveaxis(windows, (2, 3), (0, 1)).copy().reshape(-1, *ranks.shape)]
    spare = np.empty_like(values[0])
    for low, high in _comparators(len(values), int(ranks.max()) + 1):
        np.minimum(values[low], values[high], out=spare)
        np.maximum(values[low], values[high], out=values[high])
        values[low], spare = spare, values[low]
    picked = values[0]
    for rank in range(1, int(ranks.max()) + 1):
        np.copyto(picked, values[rank], where=ranks == rank)
    return picked


def _comparators(count: int, wanted: int) -> list[tuple[int, int]]:
    """Return comparators that bring the `wanted` smallest of `count` values into order.

    These are the comparators of Batcher's merge exchange (Knuth, TAOCP 3, algorithm 5.2.2M) on
    which the first values depend.
    """
    largest = 1 << (count - 1).bit_length() >> 1
    step, pairs = largest, list[tuple[int, int]]()
    while step:
        bound, remainder, distance = largest, 0, step
        while distance:
            pairs += ((i, i + distance) for i in range(count - distance) if i & step == remainder)
            distance, bound, remainder = bound - step, bound >> 1, step
        step >>= 1
    needed, kept = set(range(wanted)), list[tuple[int, int]]()
    for pair in reversed(pairs):
        if not needed.isdisjoint(pair):
            needed.update(pair)
            kept.append(pair)
    return kept[::-1]
