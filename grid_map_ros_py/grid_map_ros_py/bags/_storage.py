# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Common interface of the files of bags, MCAP and sqlite3."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, Protocol

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


class Storage(Protocol):
    """A file with messages that is open for reading.

    If the file is damaged, its methods may raise any exception; call them within `bag_errors`.
    """

    topics: dict[str, Topic]

    def entries(self, topic: str) -> list[Entry]:
        """Return the messages on a topic in time order, without reading them."""

    def read(self, entry: Entry) -> bytes:
        """Return a message as it was recorded."""

    def close(self) -> None:
        """Close the file."""


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
