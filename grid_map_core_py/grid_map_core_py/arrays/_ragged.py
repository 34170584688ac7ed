# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Ragged arrays: groups of different sizes, stored one after another in flat arrays."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[np.int64]


def expanded(counts: Integers, limit: int) -> Iterator[tuple[Integers, Integers]]:
    """Yield the members of groups, at most `limit` at once.

    Args:
        counts: (G,) how many members each group has.

    Yields:
        groups: (n,) the group of each member.
        members: (n,) its number within the group, from 0.
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
