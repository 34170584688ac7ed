# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What a filter is.

A filter is a frozen dataclass that can be called. Its fields are its YAML parameters: `build` in
`grid_map_core_py.plugins` checks their names and types, `__post_init__` their values. Calling it
takes a map whose start index is (0, 0) and returns a new one that shares the layers it leaves
alone; a filter never writes into its input. What it cannot do it raises; what the user should know
it warns of.
"""

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Protocol

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check

from ._shared.disc import Disc


class Filter(Protocol):
    """Anything that turns one map into another; a dataclass when it is to be found in YAML."""

    def __call__(self, grid_map: GridMap) -> GridMap:
        """Return the filtered map; the input stays as it is."""


class FilterWarning(UserWarning):
    """A filter did its work, but the user should know something about the result."""


_running: ContextVar[tuple[str, list[str] | None]] = ContextVar("_running", default=("", None))
"""Name of the step that this thread runs, and the list that collects its warnings."""


@contextmanager
def running(step: object, collected: list[str] | None) -> Iterator[None]:
    """Let `warn` name a step of a chain, and append to `collected` unless it is None."""
    token = _running.set((f"{step}: ", collected))
    try:
        yield
    finally:
        _running.reset(token)


def warn(message: str) -> None:
    """Warn the user of something that does not keep a filter from doing its work.

    In a chain the message names the filter, and goes to the list that the caller gave to the chain.
    Without such a list, and outside of chains, it becomes a `FilterWarning` of Python.
    """
    step, collected = _running.get()
    if collected is None:
        warnings.warn(step + message, FilterWarning, stacklevel=2)
    else:
        collected.append(step + message)


def check_radius(radius: float, name: str = "radius") -> None:
    """Check the parameter `name` of a filter that looks at a disc around each cell."""
    check(math.isfinite(radius) and radius >= 0, name, "a length >= 0 [m]", radius)


@dataclass(frozen=True, kw_only=True)
class DiscFilter:
    """What the filters have in common that make a layer from the disc around each cell.

    Attributes:
        input_layer: the layer to filter.
        output_layer: the result goes there.
        radius: of the disc [m], 0 or more; the rim is inside.
    """

    input_layer: str
    output_layer: str
    radius: float

    def __post_init__(self) -> None:
        check_radius(self.radius)

    def disc(self, grid_map: GridMap) -> Disc:
        """Return the disc on the cells of a map."""
        return Disc(self.radius, grid_map.resolution, grid_map.size)
