# SPDX-License-Identifier: BSD-3-Clause
"""Work on the newest of some things, in a thread of its own."""

import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

T = TypeVar("T")


class LatestOnly(Generic[T]):
    """Calls a function in a thread; of the things that wait for it, only the newest one counts.

    Args:
        function: called with one thing at a time.
    """

    def __init__(self, function: Callable[[T], object]) -> None:
        self._function = function
        self._change = threading.Condition()
        self._waiting: T | None = None
        self._is_closed = False
        self._outcomes: deque[Exception | None] = deque(maxlen=100)
        # A daemon: a disk that hangs must not keep the program from ending.
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, thing: T) -> None:
        """Let the thread take a thing, in place of one that waits."""
        with self._change:
            self._waiting = thing
            self._change.notify()

    def outcomes(self) -> Iterator[Exception | None]:
        """Yield for each finished call its error, or None."""
        while self._outcomes:
            yield self._outcomes.popleft()

    def close(self, timeout: float) -> bool:
        """Wait until the thing that waits is worked on, too; return whether that is so in time [s].

        The thread takes no further things.
        """
        with self._change:
            self._is_closed = True
            self._change.notify()
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _run(self) -> None:
        while (thing := self._next()) is not None:
            try:
                self._function(thing)
            except Exception as error:  # for the thread that asks for outcomes
                self._outcomes.append(error)
            else:
                self._outcomes.append(None)

    def _next(self) -> T | None:
        with self._change:
            self._change.wait_for(lambda: self._waiting is not None or self._is_closed)
            thing, self._waiting = self._waiting, None
            return thing
