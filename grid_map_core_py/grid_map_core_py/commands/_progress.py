# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A progress bar for runs over many maps."""

import io
import sys
import time
from collections.abc import Callable
from typing import TextIO

WIDTH = 30
"""Characters of the bar."""

PERIOD = 0.1
"""Time between two updates of the line [s]."""


class ProgressBar:
    """Shows progress: `[#####.....] 12/24 maps, 3.1 maps/s, 0:04 left`.

    Leaving the context ends the line. If the stream is not a terminal, for example a log file, only
    the last state is written.

    Args:
        stream: None means standard error.
        clock: returns the time [s].
        quiet: show nothing.
    """

    def __init__(
        self,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
        *,
        quiet: bool = False,
    ) -> None:
        self._stream = io.StringIO() if quiet else stream or sys.stderr
        self._clock = clock
        self._begin = clock()
        self._shown_at = -PERIOD
        self._shown = ""
        self._state: tuple[int, int | None] = (0, None)

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, *_: object) -> None:
        self._show()
        self._write("\n")

    def __call__(self, done: int, total: int | None = None) -> None:
        """Show that `done` of `total` maps are finished; None if `total` is unknown."""
        self._state = (done, total)
        now = self._clock()
        if self._stream.isatty() and now - self._shown_at >= PERIOD:
            self._shown_at = now
            self._show()

    def _show(self) -> None:
        text = progress_text(*self._state, self._clock() - self._begin)
        start = "\r" if self._stream.isatty() else ""
        # Spaces overwrite the rest of a longer line.
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
    text = f"[{bar}] {done}/{total} maps, {rate:.1f} maps/s"
    if not rate or done >= total:
        return text
    minutes, rest = divmod(round((total - done) / rate), 60)
    return f"{text}, {minutes}:{rest:02} left"
