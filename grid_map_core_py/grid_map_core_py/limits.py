# SPDX-License-Identifier: BSD-3-Clause
"""Limits on the size of messages, files and requests, checked before memory is allocated.

A message of a few bytes can declare a map of any size, so sizes are checked when data is read. The
constructor `GridMap(...)` has no limit. Set limits permanently or for a `with` block::

    from grid_map_core_py.limits import changed_limits, set_limits

    set_limits(max_cells=100_000_000)
    with changed_limits(max_bytes=1e10):
        grid_map = load("map.npz")

Both functions affect all threads of the process.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

from ._parameters import check
from .errors import LimitError

__all__ = [
    "Limits",
    "changed_limits",
    "current_limits",
    "set_limits",
]

FREE_BYTES = 100_000_000
"""Size of unpacked data [bytes] up to which `max_ratio` is ignored; uniform maps compress well."""

VISITS = 4
"""Largest total number of cells in overlapping parts of a map, as a multiple of `max_cells`."""


@dataclass(frozen=True)
class Limits:
    """Limits on maps and files.

    Each limit is a finite number of at least 1.

    Attributes:
        max_cells: largest number of cells (rows times columns) in a map, or of pixels in an image.
        max_bytes: largest size [bytes]. It applies to maps with all layers, to unpacked messages
            and bag chunks, and to octomap files.
        max_ratio: largest ratio of unpacked to packed bytes. Data that unpacks to at most 100 MB
            may have any ratio.
    """

    max_cells: float = 16_000_000
    max_bytes: float = 4_000_000_000
    max_ratio: float = 1100  # Deflate compresses at most 1032 bytes into one.

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            is_limit = isinstance(value, int | float) and 1 <= value < math.inf
            check(is_limit, name, "a finite number of at least 1", value)


_limits = Limits()


def current_limits() -> Limits:
    """Return the current limits."""
    return _limits


def set_limits(limits: Limits | None = None, /, **changes: float) -> Limits:
    """Set the limits of the process and return the previous limits.

    Args:
        limits: new limits; None means the current limits.
        changes: new values of `max_cells`, `max_bytes` or `max_ratio`; they replace those in
            `limits`.
    """
    global _limits
    before = _limits
    _limits = replace(limits or before, **changes)
    return before


@contextmanager
def changed_limits(**changes: float) -> Iterator[None]:
    """Context manager that changes limits, as `set_limits` does, and restores them on exit."""
    before = set_limits(**changes)
    try:
        yield
    finally:
        set_limits(before)


def check_cells(name: str, size: Sequence[float], layers: int = 0) -> None:
    """Raise `LimitError` if a map, or `layers` layers of it, would be too large."""
    cells = size[0] * size[1]
    if not cells <= current_limits().max_cells:
        rows, columns = (f"{count:.15g}" for count in size)
        _refuse("max_cells", name, "cells", f"{rows} x {columns}")
    if cells * layers * 4 > current_limits().max_bytes:
        _refuse("max_bytes", name, "bytes", f"{layers} layers of {cells * 4:.15g} bytes")


def check_visits(name: str, visits: float) -> None:
    """Raise `LimitError` if the number of cell visits exceeds `VISITS * max_cells`."""
    if visits > VISITS * current_limits().max_cells:
        _refuse("max_cells", name, f"times {VISITS} cells under all of them", f"{visits:.0f}")


def check_bytes(name: str, unpacked: int, packed: float) -> None:
    """Raise `LimitError` if the sizes [bytes] of compressed data exceed the limits."""
    if unpacked > current_limits().max_bytes:
        _refuse("max_bytes", name, "bytes", f"{unpacked}")
    if unpacked > max(FREE_BYTES, current_limits().max_ratio * packed):
        _refuse("max_ratio", name, "bytes from one byte", f"{unpacked} unpacked from {packed}")


def _refuse(limit: str, name: str, unit: str, found: str) -> None:
    raise LimitError(
        f"{name}: expected at most {getattr(current_limits(), limit):.15g} {unit}, got {found}. "
        f"To raise the limit: the parameter {limit} of a node, "
        f"--{limit.replace('_', '-')} of grid-map, "
        f"set_limits({limit}=...) in Python"
    )
