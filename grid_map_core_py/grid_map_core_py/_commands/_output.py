# SPDX-License-Identifier: BSD-3-Clause
"""Command-line output: tables, JSON, messages, errors and progress."""

import json
import math
import sys
import time
from collections.abc import Sequence
from datetime import timedelta

from ..errors import GridMapError, cut

_BAR = 30  # length of a progress bar [characters]
_PERIOD = 0.1  # time between updates of the progress line [s]
_JSON_PERIOD = 1.0  # time between JSON lines [s]


class CommandError(GridMapError):
    """Failure of a command; exit code 1."""


class UsageError(CommandError):
    """Invalid command-line arguments; exit code 2."""


def message(text: str) -> None:
    """Print a line to standard error, escaped and shortened by `shown`."""
    print(f"grid-map: {shown(text)}", file=sys.stderr)


def print_json(value: object) -> None:
    print(json.dumps(value, indent=2, allow_nan=False))


def table(rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """Format rows as a table with the columns `numbers` right-aligned."""
    columns = [
        [f"{cell:{'>' if number in numbers else '<'}{max(map(len, column))}}" for cell in column]
        for number, column in enumerate(zip(*rows, strict=True))
    ]
    return "\n".join("  ".join(row).rstrip() for row in zip(*columns, strict=True))


def print_table(rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> None:
    print(table(rows, numbers))


def shown(text: str) -> str:
    """Escape control characters, and shorten the text to 500 characters."""
    return cut("".join(one if one.isprintable() else repr(one)[1:-1] for one in cut(text)))


def number(value: float) -> str:
    return f"{value:.6g}"


def coordinate(value: float) -> str:
    """Format a coordinate [m] with 12 digits, enough for millimeters in UTM."""
    return f"{value:.12g}"


def byte_count(size: int) -> str:
    value = float(size)
    for unit in ("B", "kB", "MB"):
        if value < 1000:
            return f"{value:.3g} {unit}"
        value /= 1000
    return f"{value:.3g} GB"


class ProgressBar:
    """Shows progress: `[#####.....] 12/24 maps, 3.1 maps/s, 0:04 left`.

    Args:
        quiet: hide the progress; ignored with `as_json`.
        unit: plural name of the counted items.
        cells: number of cells per item, to show cells per second; 0 shows items per second.
        as_json: print JSON lines to standard output instead.
    """

    def __init__(
        self, *, quiet: bool = False, unit: str = "maps", cells: float = 0.0, as_json: bool = False
    ) -> None:
        self._stream = sys.stdout if as_json else sys.stderr
        self._quiet = quiet and not as_json
        self._unit, self._cells, self._as_json = unit, cells, as_json
        self._begin = time.monotonic()
        self._before = None if cells else 0  # None: the first call starts the measurement.
        self._shown_at = -math.inf
        self._done = 0
        self._total: int | None = None

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, *_: object) -> None:
        if self._as_json or (self._before is not None and not self._quiet):
            self._show(end="\n")

    def __call__(self, done: int, total: int | None = None) -> None:
        """Update the number of finished items; `total` is None if unknown."""
        self._done, self._total = done, total
        now = time.monotonic()
        if self._before is None:
            self._begin, self._before = now, done
        shows = self._as_json or (self._stream.isatty() and not self._quiet)
        if shows and now - self._shown_at >= (_JSON_PERIOD if self._as_json else _PERIOD):
            self._shown_at = now
            self._show(end="\n" if self._as_json else "")

    def _show(self, end: str) -> None:
        done, total, seconds = self._done, self._total, time.monotonic() - self._begin
        rate = (done - (self._before or 0)) / seconds if seconds > 0 else 0.0
        left = (total - done) / rate if total is not None and rate else 0.0
        pace = ("cells", rate * self._cells) if self._cells else (self._unit, rate)
        if self._as_json:
            facts = {self._unit: done, "of": total, "seconds": seconds}
            facts |= {f"{pace[0]}_per_second": pace[1], "seconds_left": left}
            text = json.dumps(facts)
        else:
            text = f"{done} {self._unit}, {pace[1]:.3g} {pace[0]}/s"
            if total is not None:
                filled = _BAR * done // max(total, 1)
                text = f"[{'#' * filled:.<{_BAR}}] {text.replace(' ', f'/{total} ', 1)}"
            if left:
                text += f", {timedelta(seconds=round(left))} left"
            if self._stream.isatty():
                text = f"\r{text}\x1b[K"  # erases the rest of a longer line
        self._stream.write(text + end)
        self._stream.flush()
