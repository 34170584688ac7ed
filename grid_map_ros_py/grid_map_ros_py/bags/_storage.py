# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Topics, entries and errors of the files of bags, for MCAP and sqlite3 alike."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from grid_map_core_py.errors import GridMapError

from ..errors import BagError


class Topic(NamedTuple):
    """Type and encoding of the messages on a topic."""

    type: str
    encoding: str


class Entry(NamedTuple):
    """Time of a message [ns] and its place in the file, in terms of the format."""

    time: int
    place: Any


@contextmanager
def bag_errors(path: Path, doing: str = "read") -> Iterator[None]:
    """Turn every exception into one `BagError` that names the file."""
    try:
        yield
    except GridMapError:
        raise
    except OSError as error:
        raise BagError(path, f"cannot be {doing}: {error.strerror or error}") from error
    # Depending on the damage, the reading packages raise any kind of exception.
    except Exception as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise BagError(path, f"cannot be {doing}: {text}") from error
