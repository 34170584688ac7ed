# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Tables, JSON, messages and errors, as the command line prints them."""

import json
import sys
from collections.abc import Sequence

from ..errors import GridMapError


class CommandError(GridMapError):
    """A command failed: exit code 1."""


class UsageError(CommandError):
    """The arguments are invalid, independent of the files: exit code 2."""


def message(text: str) -> None:
    """Print a line of text for the user, to standard error."""
    print(f"grid-map: {text}", file=sys.stderr)


def print_json(value: object) -> None:
    """Print data as JSON."""
    print(json.dumps(value, indent=2, allow_nan=False))


def print_table(rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> None:
    """Print rows as a table; the columns `numbers` are aligned to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        cells = [
            cell.rjust(width) if column in numbers else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        print("  ".join(cells).rstrip())


def shown(text: str) -> str:
    """Return a name from a file with control characters escaped."""
    return "".join(one if one.isprintable() else repr(one)[1:-1] for one in text)


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
