# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Work on parts of a map in several threads.

NumPy, OpenCV and compiled loops release Python's lock, so that threads compute at the same time.
The parts are the same for any number of threads, and so are the results.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from threading import Lock
from typing import Generic, TypeVar

import numpy as np

T = TypeVar("T")

CELLS = 2**17
"""Cells of a part. One operation on fewer takes less time than waking up the thread that waits for
Python's lock meanwhile."""

_helpers: ContextVar[tuple[ThreadPoolExecutor | None, int]] = ContextVar(
    "_helpers", default=(None, 0)
)
"""Threads that help the one that runs a chain, and their number."""


@contextmanager
def use_threads(count: int) -> Iterator[None]:
    """Let `side_by_side` use `count` threads; the calling thread is one of them."""
    if count == 1:
        yield
        return
    # Threads start when there is work for them.
    with ThreadPoolExecutor(count - 1, "grid_map_filters") as pool:
        token = _helpers.set((pool, count - 1))
        try:
            yield
        finally:
            _helpers.reset(token)


def thread_count() -> int:
    """Return the number of threads that `side_by_side` uses here."""
    return 1 + _helpers.get()[1]


def side_by_side(function: Callable[[T], object], parts: Iterable[T]) -> None:
    """Call a function with each part, in as many threads as the running chain may use.

    Outside of a chain with several threads, this is a loop. The settings of `numpy.errstate`, and
    the step that `warn` names, are those of the caller.

    Args:
        function: is called in any order, by several threads at the same time.
        parts: are taken one after the other.

    Raises:
        Exception: a call has failed. Further parts are not begun.
    """
    pool, count = _helpers.get()
    if pool is None:
        for part in parts:
            function(part)
        return
    shared, settings = _Shared(parts), np.geterr()

    def work() -> None:
        # A part has no parts of its own, which would wait for the same threads.
        token = _helpers.set((None, 0))
        try:
            with np.errstate(**settings):
                for part in shared:
                    function(part)
        finally:
            shared.end()
            _helpers.reset(token)

    helpers = []
    try:
        for _ in range(count):
            helpers.append(pool.submit(copy_context().run, work))
        work()
    finally:
        shared.end()
        for helper in helpers:
            helper.cancel()
        errors = [helper.exception() for helper in helpers if not helper.cancelled()]
    for error in filter(None, errors):
        raise error


class _Shared(Generic[T]):
    """Parts that several threads take one after the other."""

    def __init__(self, parts: Iterable[T]) -> None:
        self._rest, self._lock = iter(parts), Lock()

    def __iter__(self) -> Iterator[T]:
        while True:
            with self._lock:
                try:
                    part = next(self._rest)
                except StopIteration:
                    return
            yield part

    def end(self) -> None:
        """Give no more parts to any thread."""
        with self._lock:
            self._rest = iter(())
