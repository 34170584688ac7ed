# SPDX-License-Identifier: BSD-3-Clause
"""Makes glibc keep freed memory for reuse."""

import ctypes
from contextlib import suppress

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # options of `mallopt`

LARGEST_BLOCK = 2**25
"""Size [bytes] above which glibc, by default, returns each freed block to the system."""


def keep_memory() -> None:
    """Make glibc keep up to 1 GB of freed memory, to speed up large messages and tiles.

    By default, glibc returns each freed block above 32 MB to the system. The kernel must then clear
    the memory of the next block, which takes longer than copying a message. Subscriptions of this
    suite call this function for large messages. Call it in nodes that only publish large messages.
    """
    with suppress(AttributeError):  # Other C libraries have no `mallopt`.
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_M_MMAP_MAX, 0)
        mallopt(_M_TRIM_THRESHOLD, 2**30)
