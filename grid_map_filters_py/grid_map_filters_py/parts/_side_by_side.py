# SPDX-License-Identifier: BSD-3-Clause
"""Work on parts of a map in several threads.

NumPy, OpenCV and compiled loops release Python's lock, so that threads compute at the same time.
The parts are the same for any number of threads, and so are the results.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from threading import Event, Lock
from typing import TypeVar

import numpy as np

T = TypeVar("T")

CELLS = 2**17
"""Cells of a part; with fewer, waking a waiting thread would take longer than the work."""

_threads: ContextVar[int] = ContextVar("_threads", default=1)
"""Number of threads of the running chain; the thread that runs it is one of them."""


@contextmanager
def use_threads(count: int) -> Iterator[None]:
    """Let `side_by_side` use `count` threads; the calling thread is one of them."""
    token = _threads.set(count)
    try:
        yield
    finally:
        _threads.reset(token)


def thread_count() -> int:
    """Return the number of threads that `side_by_side` uses here."""
    return _threads.get()


def side_by_side(function: Callable[[T], object], parts: Iterable[T]) -> None:
    """Call a function with each part, in as many threads as the running chain may use.

    Outside of a chain with several threads, this is a loop. The settings of `numpy.errstate`, and
    the step that `warn` names, are those of the caller.

    Args:
        function: called in any order, by several threads at the same time.
        parts: arguments of the calls, taken one after the other.

    Raises:
        Exception: a call has failed. Further parts are not begun.
    """
    helpers = thread_count() - 1
    if helpers == 0:
        for part in parts:
            function(part)
        return
    rest, taking, ended, settings = iter(parts), Lock(), Event(), np.geterr()

    def work() -> None:
        try:
            # Within a part, nested calls use no further threads.
            with use_threads(1), np.errstate(**settings):
                while not ended.is_set():
                    with taking:
                        try:
                            part = next(rest)
                        except StopIteration:
                            return
                    function(part)
        finally:
            ended.set()

    with ThreadPoolExecutor(helpers) as pool:
        try:
            working = [pool.submit(copy_context().run, work) for _ in range(helpers)]
            work()
        finally:
            ended.set()
    for helper in working:
        helper.result()
