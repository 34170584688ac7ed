# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Tables, JSON, messages, errors and progress, as the command line prints them."""

import io
import json
import sys
import time
from collections.abc import Callable, Sequence
from typing import TextIO

from ..errors import GridMapError, cut

_BAR = 30  # characters of a progress bar
_PERIOD = 0.1  # time between two updates of its line [s]


class CommandError(GridMapError):
    """A command failed: exit code 1."""


class UsageError(CommandError):
    """The arguments are invalid, independent of the files: exit code 2."""


def message(text: str) -> None:
    """Print a line of text for the user, to standard error, as `shown` returns it."""
    print(f"grid-map: {shown(text)}", file=sys.stderr)


def print_json(value: object) -> None:
    """Print data as JSON."""
    print(json.dumps(value, indent=2, allow_nan=False))


def table(rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """Return rows as a table; the columns `numbers` are aligned to the right."""
    columns = [
        [f"{cell:{'>' if number in numbers else '<'}{max(map(len, column))}}" for cell in column]
        for number, column in enumerate(zip(*rows, strict=True))
    ]
    return "\n".join("  ".join(row).rstrip() for row in zip(*columns, strict=True))


def print_table(rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> None:
    """Print rows as a table, as `table` returns it."""
    print(table(rows, numbers))


def shown(text: str) -> str:
    """Return a text with control characters escaped, and at most 500 characters of it."""
    return cut("".join(one if one.isprintable() else repr(one)[1:-1] for one in cut(text)))


def number(value: float) -> str:
    """Return a number with six significant digits."""
    return f"{value:.6g}"


def coordinate(value: float) -> str:
    """Return a length or coordinate; a northing keeps its millimeters."""
    return f"{value:.12g}"


def byte_count(size: int) -> str:
    """Return a number of bytes in a unit of suitable size."""
    value = float(size)
    for unit in ("B", "kB", "MB"):
        if value < 1000:
            return f"{value:.3g} {unit}"
        value /= 1000
    return f"{value:.3g} GB"


def can_print(text: str) -> bool:
    """Return whether standard output has these characters."""
    try:
        text.encode(sys.stdout.encoding or "ascii")
    except UnicodeEncodeError:
        return False
    return True


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
        self._shown_at = -_PERIOD
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
        if self._stream.isatty() and now - self._shown_at >= _PERIOD:
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
    filled = _BAR * done // total if total else _BAR
    bar = "#" * filled + "." * (_BAR - filled)
    text = f"[{bar}] {done}/{total} maps, {rate:.1f} maps/s"
    if not rate or done >= total:
        return text
    minutes, rest = divmod(round((total - done) / rate), 60)
    return f"{text}, {minutes}:{rest:02} left"
