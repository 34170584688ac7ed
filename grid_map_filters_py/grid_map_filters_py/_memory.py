# SPDX-License-Identifier: BSD-3-Clause
"""Memory that filters free, kept for the next filter, where the C library is glibc.

glibc gives freed memory back to the system as soon as it is more than twice the largest block that
was freed before. The system clears the pages of the next temporaries, which takes half of the time
of a chain on 400 x 400 cells.
"""

import math

import numpy as np

from grid_map_core_py._arrays import Size

_BYTES_PER_CELL = 64
"""Half of the memory that is kept: that of 32 layers in single precision."""

_LARGEST = 2**25 - 2**16
"""Larger blocks do not change what glibc keeps."""

_largest_so_far = 0


def keep_temporaries(size: Size) -> None:
    """Let glibc keep temporaries of filters of maps of this size; at most 64 MB."""
    global _largest_so_far
    size_of_block = min(_BYTES_PER_CELL * math.prod(size), _LARGEST)
    if size_of_block > _largest_so_far:
        _largest_so_far = size_of_block
        # Freed at once. Its pages are never used, so that it takes no memory.
        np.empty(size_of_block, np.uint8)
