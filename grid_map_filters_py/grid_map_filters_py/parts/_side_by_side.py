# SPDX-License-Identifier: BSD-3-Clause
"""Processes parts of a map in several threads.

NumPy, OpenCV and compiled loops release the global interpreter lock, so the threads run in
parallel. Neither the parts nor the results depend on the number of threads.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from typing import TypeVar

import numpy as np

T = TypeVar("T")

CELLS = 2**17
"""Number of cells per part; for smaller parts, waking a thread takes longer than the work."""

_threads: ContextVar[int] = ContextVar("_threads", default=1)
"""Number of threads of the running chain."""


@contextmanager
def use_threads(count: int) -> Iterator[None]:
    """Let `side_by_side` use `count` threads."""
    token = _threads.set(count)
    try:
        yield
    finally:
        _threads.reset(token)


def thread_count() -> int:
    """Return the number of threads that `side_by_side` uses in this context."""
    return _threads.get()


def side_by_side(function: Callable[[T], object], parts: Iterable[T]) -> None:
    """Call `function` with each part, in as many threads as the running chain may use.

    Outside a chain with several threads, the calls run in a loop. All threads use the
    `numpy.errstate` settings of the caller. Their warnings name the filter that called this
    function.

    Args:
        function: called with one part per call. Several threads call it at once, in no particular
            order.
        parts: arguments of the calls.

    Raises:
        Exception: a call failed; calls that have not started are canceled.
    """
    if thread_count() == 1:
        for part in parts:
            function(part)
        return
    settings = np.geterr()

    def work(part: T) -> None:
        # Nested calls within a part use no further threads.
        with use_threads(1), np.errstate(**settings):
            function(part)

    with ThreadPoolExecutor(thread_count()) as pool:
        calls = [pool.submit(copy_context().run, work, part) for part in parts]
        try:
            wait(calls, return_when=FIRST_EXCEPTION)
        finally:
            pool.shutdown(cancel_futures=True)
    for call in calls:
        call.result()
