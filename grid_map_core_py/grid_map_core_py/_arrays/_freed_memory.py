# SPDX-License-Identifier: BSD-3-Clause
"""Reuse of freed memory, with the C library glibc."""

import ctypes
from contextlib import suppress

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # options of `mallopt`

LARGEST_BLOCK = 2**25
"""Bytes above which glibc gets every block from the system, and returns it when it is freed."""


def keep_memory() -> None:
    """Keep up to 1 GB of freed memory, for messages above 32 MB and for tiles.

    By default, glibc returns such blocks to the system at once, and the system clears the pages of
    the next one, which takes longer than copying a message. Subscriptions of this suite call this
    function for large messages; a node that only publishes them calls it itself.
    """
    with suppress(AttributeError):  # Other C libraries have no such function.
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_M_MMAP_MAX, 0)
        mallopt(_M_TRIM_THRESHOLD, 2**30)
