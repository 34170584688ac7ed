# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The filter protocol, and warnings of filters.

A filter is a frozen dataclass that can be called. Its fields are its YAML parameters:
`grid_map_core_py.plugins.build` checks their names and types, `__post_init__` their values. A call
takes a map whose start index is (0, 0), and returns a new map that shares the unchanged layers. It
never writes into its input. A filter raises an error if it cannot do its work, and calls `warn` if
the user should know something about the result.
"""

import functools
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol, TypeVar, cast

from grid_map_core_py import GridMap


class Filter(Protocol):
    """Callable from map to map; filters with a type name in YAML are dataclasses."""

    def __call__(self, grid_map: GridMap) -> GridMap:
        """Return the filtered map; the input stays unchanged."""


class FilterWarning(UserWarning):
    """Warning about the result of a filter."""


_running: ContextVar[tuple[str, list[str] | None]] = ContextVar("_running", default=("", None))
"""Name of the step that this thread runs, and the list that collects its warnings."""


@contextmanager
def running(step: object, collected: list[str] | None) -> Iterator[None]:
    """Make `warn` name a step of a chain, and append to `collected` unless it is None."""
    token = _running.set((f"{step}: ", collected))
    try:
        yield
    finally:
        _running.reset(token)


def warn(message: str) -> None:
    """Warn the user about the result of a filter.

    In a chain, the message names the filter and is appended to the list that the caller of the
    chain passed as `warnings`. Without a list or a chain, it becomes a Python warning of the class
    `FilterWarning`.
    """
    step, collected = _running.get()
    if collected is None:
        warnings.warn(step + message, FilterWarning, stacklevel=2)
    else:
        collected.append(step + message)


C = TypeVar("C", bound=Callable[..., GridMap])


def in_map_order(call: C) -> C:
    """Decorator for `__call__` of a filter that needs maps in map order.

    A map that has moved is unwrapped, and the result is stored from its start index again. Filters
    that use neighboring cells need it outside of chains; a chain does the same.
    """

    @functools.wraps(call)
    def wrapped(self: object, grid_map: GridMap) -> GridMap:
        start = grid_map.start_index
        if start == (0, 0):
            return call(self, grid_map)
        return call(self, grid_map.with_start_index((0, 0))).with_start_index(start)

    return cast(C, wrapped)
