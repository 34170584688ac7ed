# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A sequence of filters."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

from grid_map_core_py import GridMap
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.plugins import build, check

from ._config import StepConfig, parse_steps, read_chain
from ._filter import Filter, warnings_of
from ._registry import FILTERS
from .builtin._buffer_normalizer import BufferNormalizer
from .errors import FilterConfigError, FilterError


@dataclass(frozen=True)
class Step:
    """A filter and how it was configured."""

    config: StepConfig
    filter: Filter


StepObserver = Callable[[Step, float], None]
"""Is told of every step that has run, and how long it took [s]."""


class FilterChain:
    """Filters that run one after the other.

    `chain(grid_map)` never changes its input and shares no data with it. The result keeps the start
    index of the input, unless a `BufferNormalizer` is among the filters.

    Example:
        >>> chain = FilterChain.from_config([{
        ...     "name": "roughness", "type": "gridMapFilters/MathExpressionFilter",
        ...     "params": {"expression": "abs(raw - smooth)", "output_layer": "roughness"}}])
        >>> rough = chain(GridMap((1, 1), 0.5, layers={"raw": 1.0, "smooth": 1.5}))
        >>> float(rough["roughness"][0, 0])
        0.5
    """

    def __init__(self, steps: Iterable[Step]) -> None:
        self.steps = tuple(steps)

    @classmethod
    def from_config(cls, config: object) -> "FilterChain":
        """Build a chain from the mapping under `filters:`, or from a list of {name, type, params}.

        Raises:
            FilterConfigError: naming the filter, its type and the parameter.
        """
        return cls(Step(step, _build(step)) for step in parse_steps(config))

    @classmethod
    def from_yaml(cls, path: str | Path, name: str = "filters") -> "FilterChain":
        """Build a chain from a ROS 2 parameter file or a ROS 1 file.

        Args:
            path: the file.
            name: of the parameter that holds the chain.

        Raises:
            FilterConfigError: naming the filter, its type and the parameter.
            OSError: the file cannot be read.
        """
        return cls.from_config(read_chain(path, name))

    def __call__(self, grid_map: GridMap, observer: StepObserver | None = None) -> GridMap:
        """Return the filtered map.

        Args:
            grid_map: stays as it is.
            observer: is called after each step with the step and its duration [s].

        Raises:
            FilterError: a filter failed; the message names it.
        """
        # The copy keeps filters, which share what they leave alone, from sharing it with the
        # caller.
        result = grid_map.stored_from((0, 0))
        for step in self.steps:
            begin = time.perf_counter()
            result = _run(step, result)
            if observer is not None:
                observer(step, time.perf_counter() - begin)
        keeps_start = not any(isinstance(step.filter, BufferNormalizer) for step in self.steps)
        if keeps_start and grid_map.start_index != (0, 0) and result.size == grid_map.size:
            return result.stored_from(grid_map.start_index)
        return result

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        return f"FilterChain({', '.join(step.config.name for step in self.steps)})"


def _build(config: StepConfig) -> Filter:
    try:
        return _made(FILTERS[config.type], config.params)
    # Whatever the class of a third party raises, the message must say which filter it was.
    except Exception as error:
        raise FilterConfigError(f"{config}: {message_of(error)}") from error


def _made(cls: type[Filter], params: Mapping[str, object]) -> Filter:
    result = build(cls, params) if is_dataclass(cls) else None
    if result is not None:
        _check_layers_have_names(result)
    if not callable(result):
        raise FilterConfigError(f"expected a dataclass that can be called, found {cls!r}")
    return result


def _check_layers_have_names(made: Any) -> None:
    """Check the parameters that must name a layer."""
    for field in fields(made):
        if field.name.endswith("_layer") and field.default is MISSING:
            value = getattr(made, field.name)
            check(value != "", field.name, "the name of a layer", value)


def _run(step: Step, grid_map: GridMap) -> GridMap:
    try:
        with warnings_of(step.config):
            result = step.filter(grid_map)
    except Exception as error:
        raise FilterError(f"{step.config}: {message_of(error)}") from error
    if not isinstance(result, GridMap):
        raise FilterError(f"{step.config}: gave {result!r} instead of a GridMap")
    # A filter may move its map, but the next one shall see no start index.
    return result if result.start_index == (0, 0) else result.stored_from((0, 0))


def message_of(error: Exception) -> str:
    """Return the text of an error; what it is of comes first, unless the text explains itself."""
    return str(error) if isinstance(error, GridMapError) else f"{type(error).__name__}: {error}"
