# SPDX-License-Identifier: BSD-3-Clause
"""One filter of a chain, built from its configuration and run on maps in map order."""

from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py._parameters import build
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.plugins import check

from ._config import StepConfig
from ._filter import Filter, reach_of, running
from ._registry import FILTERS
from .errors import FilterConfigError, FilterError


@dataclass(frozen=True)
class Step:
    """A filter and its configuration."""

    config: StepConfig
    filter: Filter

    @classmethod
    def from_config(cls, config: StepConfig) -> "Step":
        """Create the filter described by a configuration.

        Raises:
            FilterConfigError: the configuration is invalid; the message names the filter, its type
                and the parameter.
        """
        try:
            kind: Any = FILTERS[config.type]
            made: Any = None
            if isinstance(kind, type) and is_dataclass(kind):
                made = build(kind, config.params)
            if not callable(made):
                raise FilterConfigError(f"expected a dataclass that can be called, got {kind!r}")
            for field in fields(made):
                if field.name.endswith("_layer") and field.default is MISSING:
                    value = getattr(made, field.name)
                    check(value != "", field.name, "the name of a layer", value)
        # Filter classes of other packages may raise any exception.
        except Exception as error:
            raise FilterConfigError(f"{config}: {message_of(error)}") from error
        return cls(config, made)

    def reach(self, resolution: float) -> float:
        """Return the reach of the filter: a number of cells, or `WHOLE_MAP`.

        Raises:
            FilterError: the reach is invalid; the message names the filter.
        """
        try:
            return reach_of(self.filter, resolution)
        except Exception as error:
            raise FilterError(f"{self.config}: {message_of(error)}") from error

    def __call__(self, grid_map: GridMap, warnings: list[str] | None) -> GridMap:
        """Return the filtered map, in map order.

        Raises:
            FilterError: the filter failed; the message names the filter.
        """
        try:
            with running(self.config, warnings):
                result = self.filter(grid_map)
        except Exception as error:
            message = message_of(error)
            if isinstance(error, ValueError) and "read-only" in str(error):
                message = (
                    f"it writes into a layer of its input ({error}); "
                    "change a copy and return `grid_map.with_layers({name: copy})`"
                )
            raise FilterError(f"{self.config}: {message}") from error
        if not isinstance(result, GridMap):
            raise FilterError(f"{self.config}: returned {result!r} instead of a GridMap")
        # A filter may change the start index, but the next filter expects map order.
        return result if result.start_index == (0, 0) else result.with_start_index((0, 0))


StepObserver = Callable[[Step, float], None]
"""Function called after every step with the step and its duration [s]."""


def message_of(error: Exception) -> str:
    """Return the message of an error, prefixed with its type unless it is a `GridMapError`."""
    return str(error) if isinstance(error, GridMapError) else f"{type(error).__name__}: {error}"


def read_only(grid_map: GridMap) -> GridMap:
    """Return a map whose layers are read-only views."""
    views = {name: grid_map[name].view() for name in grid_map}
    for view in views.values():
        view.flags.writeable = False
    return grid_map.with_layers(views)


def own_layer(layer: Layer, taken: set[int]) -> Layer:
    """Return a writable view or copy of `layer`, and add its memory address to `taken`.

    `layer` is copied if it is read-only or its address is already in `taken`.
    """
    own, address = layer.view(), address_of(layer)
    try:
        own.flags.writeable = address not in taken
    except ValueError:  # The filter returned a read-only array.
        own.flags.writeable = False
    taken.add(address)
    return own if own.flags.writeable else layer.copy("F")


def address_of(layer: Layer) -> int:
    """Return the memory address of the first cell."""
    return int(layer.__array_interface__["data"][0])
