# SPDX-License-Identifier: BSD-3-Clause
"""Work on parts of a map in several threads.

NumPy, OpenCV and compiled loops release Python's lock, so that threads compute at the same time.
The parts are the same for any number of threads, and so are the results.
"""

import _thread
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from threading import Lock
from typing import Generic, TypeVar

import numpy as np

T = TypeVar("T")

CELLS = 2**17
"""Cells of a part. One operation on fewer takes less time than waking up the thread that waits for
Python's lock meanwhile."""

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
        function: is called in any order, by several threads at the same time.
        parts: are taken one after the other.

    Raises:
        Exception: a call has failed. Further parts are not begun.
    """
    if thread_count() == 1:
        for part in parts:
            function(part)
        return
    shared, settings = _Shared(parts), np.geterr()

    def work() -> None:
        try:
            # A part has no parts of its own, which would take more threads.
            with use_threads(1), np.errstate(**settings):
                for part in shared:
                    function(part)
        finally:
            shared.ended = True

    _run_in_threads(work, shared)


def _run_in_threads(work: Callable[[], None], shared: "_Shared[T]") -> None:
    """Call `work`, which takes the shared parts, in all threads; raise the first error."""
    count = thread_count() - 1
    busy = [Lock() for _ in range(count)]
    # Recording an error must not take memory, which may be out.
    errors: list[BaseException | None] = [None] * count

    def help_with(index: int) -> None:
        with busy[index]:
            try:
                work()
            except BaseException as error:
                errors[index] = error

    try:
        for index in range(count):
            # `Thread.start` would wait for ever for a thread without the memory to begin.
            _thread.start_new_thread(copy_context().run, (help_with, index))
        work()
    finally:
        shared.ended = True
        try:
            _wait_for(busy)
        finally:
            # An interrupt may have ended the first wait.
            _wait_for(busy)
    for error in filter(None, errors):
        raise error


def _wait_for(busy: Iterable[Lock]) -> None:
    """Wait for the threads that work; one that begins later finds no more parts."""
    for lock in busy:
        with lock:
            pass


class _Shared(Generic[T]):
    """Parts that several threads take one after the other, until `ended` is set."""

    def __init__(self, parts: Iterable[T]) -> None:
        self._rest, self._lock, self.ended = iter(parts), Lock(), False

    def __iter__(self) -> Iterator[T]:
        while not self.ended:
            with self._lock:
                try:
                    part = next(self._rest)
                except StopIteration:
                    return
            yield part
