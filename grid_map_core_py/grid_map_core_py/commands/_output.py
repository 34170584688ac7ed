# SPDX-License-Identifier: BSD-3-Clause
"""Tables, JSON, messages, errors and progress, as the command line prints them."""

import io
import json
import sys
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple, TextIO

from ..errors import GridMapError, cut

_BAR = 30  # characters of a progress bar
_PERIOD = 0.1  # time between two updates of its line [s]
_JSON_PERIOD = 1.0  # time between two lines of JSON [s]


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
        unit: what is counted.
        cells: cells of each, for a rate of cells; then the first call tells how many were finished
            before.
        as_json: print a line of JSON every second and at the end to the stream, which is standard
            output unless it is given.
    """

    def __init__(
        self,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
        *,
        quiet: bool = False,
        unit: str = "maps",
        cells: float = 0.0,
        as_json: bool = False,
    ) -> None:
        usual = sys.stdout if as_json else sys.stderr
        self._stream = io.StringIO() if quiet and not as_json else stream or usual
        self._clock = clock
        self._unit, self._cells, self._as_json = unit, cells, as_json
        self._period = _JSON_PERIOD if as_json else _PERIOD
        self._begin = clock()
        self._begun = None if cells else 0
        self._shown_at = -self._period
        self._shown = ""
        self._state: tuple[int, int | None] = (0, None)

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, *_: object) -> None:
        if self._as_json or self._begun is not None:
            self._show()
            self._write("" if self._as_json else "\n")

    def __call__(self, done: int, total: int | None = None) -> None:
        """Show that `done` of `total` are finished; None if `total` is unknown."""
        self._state = (done, total)
        now = self._clock()
        if self._begun is None:
            self._begin, self._begun = now, done
        shows = self._as_json or self._stream.isatty()
        if shows and now - self._shown_at >= self._period:
            self._shown_at = now
            self._show()

    def _show(self) -> None:
        about = Progress(*self._state, self._clock() - self._begin, self._begun or 0)
        if self._as_json:
            self._write(json.dumps(about.facts(self._unit, self._cells)) + "\n")
            return
        text = about.text(self._unit, self._cells)
        start = "\r" if self._stream.isatty() else ""
        # Spaces overwrite the rest of a longer line.
        self._write(start + text.ljust(len(self._shown)))
        self._shown = text

    def _write(self, text: str) -> None:
        self._stream.write(text)
        self._stream.flush()


class Progress(NamedTuple):
    """State of a run.

    Attributes:
        done: number that are finished.
        total: number of all; None if it is unknown.
        seconds: time since the begin.
        begun: number that was finished at the begin.
    """

    done: int
    total: int | None
    seconds: float
    begun: int = 0

    @property
    def rate(self) -> float:
        """Number per second."""
        return (self.done - self.begun) / self.seconds if self.seconds > 0 else 0.0

    @property
    def left(self) -> float | None:
        """Time until the end [s]; None if it is unknown or over."""
        if self.total is None or not self.rate or self.done >= self.total:
            return None
        return (self.total - self.done) / self.rate

    def text(self, unit: str = "maps", cells: float = 0.0) -> str:
        """Return the line of the progress bar."""
        pace = f"{cells * self.rate / 1e6:.3g} million cells/s" if cells else ""
        pace = pace or f"{self.rate:.1f} {unit}/s"
        if self.total is None:
            return f"{self.done} {unit}, {pace}"
        filled = _BAR * self.done // self.total if self.total else _BAR
        bar = "#" * filled + "." * (_BAR - filled)
        text = f"[{bar}] {self.done}/{self.total} {unit}, {pace}"
        if self.left is None:
            return text
        minutes, rest = divmod(round(self.left), 60)
        hours, minutes = divmod(minutes, 60)
        clock = f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
        return f"{text}, {clock} left"

    def facts(self, unit: str, cells: float) -> dict[str, float | None]:
        """Return the same as JSON has it."""
        rate = (
            {"cells_per_second": cells * self.rate} if cells else {f"{unit}_per_second": self.rate}
        )
        counts = {unit: self.done, "of": self.total, "seconds": self.seconds}
        return counts | rate | {"seconds_left": self.left or 0.0}
