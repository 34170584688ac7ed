# SPDX-License-Identifier: BSD-3-Clause
"""Memory that a process frees and keeps, where the C library is glibc."""

import ctypes
from contextlib import suppress

_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4  # options of `mallopt`

LARGEST_BLOCK = 2**25
"""Bytes above which glibc gets every block from the system, and returns it when it is freed."""


def keep_memory() -> None:
    """Keep up to 1 GB of freed memory: for messages above 32 MB, and for tiles.

    Subscriptions of this suite call it for such a message, and processes that compute tiles; a node
    that only publishes such messages calls it itself. Otherwise glibc returns such blocks to the
    system at once, and the system clears all pages of the next one, which takes longer than all
    copies of a message on its way.
    """
    with suppress(AttributeError):  # Other C libraries have no such function.
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_M_MMAP_MAX, 0)
        mallopt(_M_TRIM_THRESHOLD, 2**30)
