# SPDX-License-Identifier: BSD-3-Clause
"""Computes arrays piece by piece, so that temporary arrays fit into the CPU cache."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from ._checks import Integers

PIECE = 2**15  # number of elements in a piece of a large array
_SMALL_PIECE = 2**10  # smallest number of elements in a piece
CHUNK = 2**13  # number of points in a chunk


def elementwise(
    function: Callable[..., npt.NDArray[Any]], dtype: npt.DTypeLike, *arrays: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Compute `function(*arrays)` in pieces of shape (n,); the arrays are broadcast together."""
    iterator = np.nditer(
        (*arrays, None),
        flags=("external_loop", "buffered", "zerosize_ok"),
        op_flags=(*(("readonly",) for _ in arrays), ("writeonly", "allocate")),
        op_dtypes=(*(None for _ in arrays), np.dtype(dtype)),
        order="K",
        buffersize=piece_of(max(array.size for array in arrays)),
    )
    with iterator:
        for *pieces, piece in iterator:
            piece[...] = function(*pieces)
        result: npt.NDArray[Any] = iterator.operands[-1]
    return result


def piece_of(count: int) -> int:
    """Return the number of elements per piece of an array with `count` elements."""
    return max(_SMALL_PIECE, min(PIECE, count // 16))


def slices(count: int, step: int) -> Iterator[slice]:
    """Yield slices of `step` items; the last slice may be shorter."""
    step = max(1, step)
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))


def expanded(counts: Integers, limit: int) -> Iterator[tuple[Integers, Integers]]:
    """Yield the members of groups in chunks of at most `limit` members.

    `counts` (G,) contains the group sizes. A chunk consists of the group (n,) of each member, and
    its index (n,) within the group.
    """
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    for first in range(0, total, limit):
        last = min(first + limit, total)
        begin, end = np.searchsorted(ends, (first, last - 1), side="right")
        here = slice(begin, end + 1)
        starts = ends[here] - counts[here]
        taken = np.minimum(ends[here], last) - np.maximum(starts, first)
        groups = np.repeat(np.arange(begin, end + 1), taken)
        yield groups, np.arange(first, last) - np.repeat(starts, taken)
