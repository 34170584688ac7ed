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
"""If at most this fraction of cells is chosen, sorting each window is faster than sliding one."""

_LARGEST_BLUR = 5
"""Maximum window side that `cv2.medianBlur` supports for float32."""

_SIDE = 64
"""Side of the blocks over which a window slides [cells], unless the window is wider."""

_BUCKET = 16
"""Number of values in a bucket of `_slide`."""

_PIECE = 2**16
"""Number of values sorted at a time."""


def put_window_medians(output: Layer, layer: Layer, cells: Mask, half_width: int) -> None:
    """Write the median of the finite values in the square around each cell in the mask `cells`.

    If there are two middle values, the larger one is the median. The median is NaN where no value
    is finite. Squares extend `half_width` cells to each side.
    """
    # Wider squares would contain no additional cells.
    half_width, chosen = min(half_width, max(layer.shape) - 1), cells
    side = 2 * half_width + 1
    # Sorting moves infinity, which replaces missing values, to the end.
    padded = np.full(np.add(layer.T.shape, 2 * half_width), np.inf, np.float32)
    inner = slice(half_width, half_width + layer.shape[1]), slice(half_width, -half_width or None)
    np.copyto(padded[inner], layer.T, where=np.isfinite(layer.T))
    ranks = _counts(np.isfinite(padded), side)[inner] // 2
    fewest = _SCATTERED * cells.size
    if 1 < side <= _LARGEST_BLUR and np.count_nonzero(cells) > fewest:
        cells = _put_blurred(output, padded, cells, inner, ranks, side)
    slide = _slide.compiled() if np.count_nonzero(cells) > fewest else None
    if slide is not None:
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
        windows = sliding_window_view(padded, (side, side))
        for piece in slices(rows.size, _PIECE // side**2):
            at = rows[piece], columns[piece]
            values = windows[at].reshape(-1, side**2)
            values.sort(axis=1)
            output.T[at] = values[np.arange(len(values)), ranks[at]]
    output[chosen & np.isinf(output)] = np.nan


def _counts(mask: Mask, side: int) -> npt.NDArray[Any]:
    """Count the True values in the square around each cell."""
    counts = cv2.boxFilter(mask.view(np.uint8), cv2.CV_32S, (side, side), normalize=False)
    return np.asarray(counts)


def _put_blurred(
    output: Layer,
    padded: npt.NDArray[np.float32],
    cells: Mask,
    inner: tuple[slice, slice],
    ranks: npt.NDArray[Any],
    side: int,
) -> Mask:
    """Write the medians that `cv2.medianBlur` can compute; return a mask of the other cells.

    OpenCV needs a value in every cell, so a checkerboard of positive and negative infinity replaces
    missing values. The median is correct where a window contains the same number of both.
    """
    rest = cells.T.copy()
    for color in (0, 1):
        signed = padded.copy()
        for row in (0, 1):
            field = signed[row::2, (row + color) % 2 :: 2]
            np.negative(field, out=field, where=np.isinf(field))
        below = _counts(signed == -np.inf, side)[inner]
        is_middle = rest & (ranks + below == side**2 // 2)
        np.copyto(output.T, np.asarray(cv2.medianBlur(signed, side))[inner], where=is_middle)
        rest &= ~is_middle
    return rest.T


@loop("int64*", ("int64", 3), "uint8*", "int64*", "int64*")
def _slide(places: Any, shape: Any, used: Any, in_buckets: Any, found: Any) -> None:
    """Find the median of every window, given its rank among the values in the window.

    All values are sorted once. From one window to the next, the median moves only a few places in
    the sorted list (J. Suomela, "Median Filtering is Equivalent to Sorting", 2014).

    Args:
        places: place of each value in the sorted list.
        shape: rows and columns of the block, and side of the windows.
        used: work array that is 1 if the value at a place is in the window.
        in_buckets: work array with the number of window values in each bucket of places.
        found: (rows, columns) rank of each median in its window, replaced with its place.
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
