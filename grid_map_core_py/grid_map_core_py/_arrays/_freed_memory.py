# SPDX-License-Identifier: BSD-3-Clause
"""Keeping and returning memory that a process frees, where the C library is glibc."""

import ctypes
from contextlib import suppress

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_MMAP_MAX = -1, -3, -4
"""Options of `mallopt`."""


LARGEST_BLOCK = 2**25
"""Bytes above which glibc gets every block from the system, and gives it back when it is freed."""

_keeps: list[bool] = []
_returns: list[bool] = []


def keep_memory() -> None:
    """Keep up to 1 GB of freed memory for the next arrays: for messages above 32 MB, and for tiles.

    Subscriptions of this suite call it for such a message, and processes that compute tiles; a node
    that only publishes such messages calls it itself. By itself glibc returns blocks of this size
    to the system at once, and with the variables that workers of Dask have, smaller ones, too. The
    system clears all pages of the next one, which takes longer than all copies of a message on its
    way, or than the filters of a tile. `return_memory` forbids it.
    """
    if not _returns:
        _keeps[:] = [True]
        _set({_M_MMAP_MAX: 0, _M_TRIM_THRESHOLD: 2**30})


def return_memory() -> None:
    """Return freed arrays to the system: for a process that makes them in many sizes.

    Arrays of many sizes would fragment the memory that the process keeps.
    """
    _returns[:], _keeps[:] = [True], []
    _set({_M_MMAP_MAX: 2**16, _M_MMAP_THRESHOLD: 2**17, _M_TRIM_THRESHOLD: 2**17})


def trim_memory() -> None:
    """Return the holes between blocks in use to the system, unless `keep_memory` was called.

    Nodes do it every ten seconds. By itself glibc only returns the free memory behind the last
    block, so that a message that another block follows leaves a hole as large as itself.
    """
    if not _keeps:
        with suppress(AttributeError):  # Other libraries of C have no such function.
            ctypes.CDLL(None).malloc_trim(0)


def _set(options: dict[int, int]) -> None:
    with suppress(AttributeError):  # Other libraries of C have no such function.
        mallopt = ctypes.CDLL(None).mallopt
        for option, value in options.items():
            mallopt(option, value)
