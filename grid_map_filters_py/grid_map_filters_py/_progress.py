# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""How far a run over many maps is, in one line on a terminal."""

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import TextIO

WIDTH = 30
"""Of the bar, in characters."""

PERIOD = 0.1
"""Seconds between two updates of the line."""


class ProgressBar:
    """Shows progress: `[#####.....] 12/24 maps, 3.1 maps/s, 0:04 left`.

    Leaving the context ends the line. Where the stream is no terminal, such as a log file, that
    last state is all that is written.

    Args:
        stream: None means standard error.
        clock: returns the time [s].
    """

    def __init__(
        self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._stream = stream or sys.stderr
        self._clock = clock
        self._begin = clock()
        self._shown_at = -PERIOD
        self._shown = ""
        self._state: tuple[int, int | None] = (0, None)

    def __enter__(self) -> "ProgressBar":
        self._begin = self._clock()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._show()
        self._write("\n")

    def __call__(self, done: int, total: int | None = None) -> None:
        """Take note that `done` maps of `total`, if that is known, are through."""
        self._state = (done, total)
        now = self._clock()
        if self._stream.isatty() and now - self._shown_at >= PERIOD:
            self._shown_at = now
            self._show()

    def _show(self) -> None:
        text = progress_text(*self._state, self._clock() - self._begin)
        start = "\r" if self._stream.isatty() else ""
        # What the line before had more is wiped out.
        self._write(start + text.ljust(len(self._shown)))
        self._shown = text

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


def progress_text(done: int, total: int | None, seconds: float) -> str:
    """Return the line for `done` of `total` maps after a time."""
    rate = done / seconds if seconds > 0 else 0.0
    if total is None:
        return f"{done} maps, {rate:.1f} maps/s"
    filled = WIDTH * done // total if total else WIDTH
    bar = "#" * filled + "." * (WIDTH - filled)
    left = f", {_minutes((total - done) / rate)} left" if rate and done < total else ""
    return f"[{bar}] {done}/{total} maps, {rate:.1f} maps/s{left}"


def _minutes(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02}"
