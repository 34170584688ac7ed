# SPDX-License-Identifier: BSD-3-Clause
"""A sequence of filters, and the durations of its steps."""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import cv2
import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer, Size
from grid_map_core_py._commands import table
from grid_map_core_py._parameters import build, descriptions
from grid_map_core_py.errors import ConfigError, GridMapError, short
from grid_map_core_py.plugins import check

from ._config import StepConfig, field_name, parse_steps, read_chain
from ._filter import Filter, TileOptions, reach_of, running
from ._registry import FILTERS
from .builtin._buffer_normalizer import BufferNormalizer
from .errors import FilterConfigError, FilterError
from .parts._side_by_side import use_threads

if TYPE_CHECKING:
    from grid_map_core_py.tiled import TiledMap

    from ._tiles import FilteredTiles

_FEWEST_CELLS = 1000**2
"""Cells of the smallest map on which two threads are not slower than one.

On smaller ones most operations take less time than waking up the other thread.
"""

_MOST_THREADS = 1000
"""Threads start even if they find no work, and the system has a limited number."""


@dataclass(frozen=True)
class Step:
    """A filter and how it was configured."""

    config: StepConfig
    filter: Filter

    def reach(self, resolution: float) -> float:
        """Return how far the filter looks: a number of cells, or `WHOLE_MAP`.

        Raises:
            FilterError: the filter gives neither; the message names it.
        """
        try:
            return reach_of(self.filter, resolution)
        except Exception as error:
            raise FilterError(f"{self.config}: {message_of(error)}") from error


StepObserver = Callable[[Step, float], None]
"""Function that is called after every step, with the step and its duration [s]."""


@dataclass
class StepTime:
    """Durations of one step [ms]: of the last map, the longest one, and the sum over all maps."""

    config: StepConfig
    runs: int = 0
    last: float = 0.0
    longest: float = 0.0
    total: float = 0.0

    @property
    def mean(self) -> float:
        """Mean over all maps [ms]."""
        return self.total / self.runs if self.runs else 0.0


class StepTimes:
    """Collects the durations of the steps of a chain over many maps; prints as a table.

    It is an observer of chains. Iterating gives a `StepTime` for each step that has run, in the
    order of the chain.

    Example:
        >>> from grid_map_core_py import GridMap
        >>> from grid_map_filters_py import FilterChain
        >>> times = StepTimes()
        >>> chain = FilterChain.from_config([{
        ...     "name": "twice", "type": "gridMapFilters/MathExpressionFilter",
        ...     "params": {"expression": "2 * height", "output_layer": "height"}}])
        >>> for height in range(3):
        ...     _ = chain(GridMap((1, 1), 0.5, layers={"height": height}), times)
        >>> [(time.config.name, time.runs, time.mean > 0) for time in times]
        [('twice', 3, True)]
    """

    def __init__(self) -> None:
        self._times: dict[tuple[int, str], StepTime] = {}

    def __call__(self, step: Step, seconds: float) -> None:
        """Add the duration of a step."""
        config = step.config
        time = self._times.setdefault((config.number, config.name), StepTime(config))
        time.last = 1e3 * seconds
        time.runs += 1
        time.longest = max(time.longest, time.last)
        time.total += time.last

    def __iter__(self) -> Iterator[StepTime]:
        return (self._times[key] for key in sorted(self._times))

    def __len__(self) -> int:
        return len(self._times)

    @property
    def last(self) -> float:
        """Sum of the last durations of all steps [ms]."""
        return sum(time.last for time in self)

    @property
    def mean(self) -> float:
        """Sum of the mean durations of all steps [ms]."""
        return sum(time.mean for time in self)

    def __str__(self) -> str:
        total = sum(time.total for time in self)
        rows = [["step", "type", "maps", "last ms", "mean ms", "max ms", "share"]]
        for step in self:
            milliseconds = (f"{value:.3f}" for value in (step.last, step.mean, step.longest))
            share = f"{step.total / total:.0%}" if total else ""
            rows.append([step.config.name, step.config.type, str(step.runs), *milliseconds, share])
        rows.append(["sum", "", "", f"{self.last:.3f}", f"{self.mean:.3f}", "", ""])
        return table(rows, numbers=range(2, 7))


class FilterChain:
    """Filters that run one after the other.

    `chain(grid_map)` never changes its input and shares no data with it. The result keeps the start
    index of the input, unless a `BufferNormalizer` is among the filters. Several threads may call
    one chain at the same time.

    Filters get maps whose layers are read-only: one that writes into a layer fails.

    Args:
        steps: the filters in their order.
        threads: number of threads that the filters may use, from 1 to 1000. Results do not depend
            on it; small maps take one.

    Raises:
        FilterConfigError: `threads` is no such integer.

    Example:
        >>> chain = FilterChain.from_config([{
        ...     "name": "roughness", "type": "gridMapFilters/MathExpressionFilter",
        ...     "params": {"expression": "abs(raw - smooth)", "output_layer": "roughness"}}])
        >>> rough = chain(GridMap((1, 1), 0.5, layers={"raw": 1.0, "smooth": 1.5}))
        >>> float(rough["roughness"][0, 0])
        0.5
    """

    def __init__(self, steps: Iterable[Step], *, threads: int = 1) -> None:
        """Make a chain; the arguments are described at the class."""
        is_integer = isinstance(threads, int) and not isinstance(threads, bool)
        if not (is_integer and 1 <= threads <= _MOST_THREADS):
            expected = f"an integer from 1 to {_MOST_THREADS}"
            raise FilterConfigError(f"threads: expected {expected}, got {short(threads)}")
        self.steps = tuple(steps)
        self.threads = threads

    @classmethod
    def from_config(cls, config: object, *, threads: int = 1) -> "FilterChain":
        """Build a chain from the mapping under `filters:`, or from a list of {name, type, params}.

        Raises:
            FilterConfigError: naming the filter, its type and the parameter.
        """
        return cls((Step(step, _build(step)) for step in parse_steps(config)), threads=threads)

    @classmethod
    def from_yaml(
        cls, path: str | Path, name: str = "filters", *, threads: int = 1
    ) -> "FilterChain":
        """Build a chain from a ROS 2 parameter file, a ROS 1 file, or a file with only the list.

        Args:
            path: the file.
            name: parameter that holds the chain.
            threads: see the class.

        Raises:
            FilterConfigError: naming the filter, its type and the parameter.
            OSError: the file cannot be read.
        """
        return cls.from_config(read_chain(path, name), threads=threads)

    def __call__(
        self,
        grid_map: GridMap,
        observer: StepObserver | None = None,
        *,
        warnings: list[str] | None = None,
    ) -> GridMap:
        """Return the filtered map.

        Args:
            grid_map: stays unchanged.
            observer: is called after each step with the step and its duration [s].
            warnings: list to which the warnings of the filters are appended; None issues each as a
                `FilterWarning`.

        Raises:
            FilterError: a filter failed; the message names it.
        """
        if not OPENCV_KEEPS_READ_ONLY and grid_map.start_index == (0, 0):
            grid_map = grid_map.copy()
        result, start = self.without_copies(grid_map, observer, warnings=warnings)
        if start != (0, 0):
            return result.with_start_index(start)
        taken = {_address(grid_map[name]) for name in grid_map}
        return result.with_layers({name: own_layer(result[name], taken) for name in result})

    def without_copies(
        self,
        grid_map: GridMap,
        observer: StepObserver | None = None,
        *,
        warnings: list[str] | None = None,
    ) -> tuple[GridMap, Size]:
        """Return the filtered map in map order, and the start index that a call would give it.

        Layers that no filter has changed are those of the input, unless it has moved. All layers
        are read-only. Nodes use this to write the result into a message at once.

        Arguments and errors: see a call.
        """
        result = grid_map
        if grid_map.start_index != (0, 0):
            result = grid_map.with_start_index((0, 0))
        threads = self.threads if math.prod(grid_map.size) >= _FEWEST_CELLS else 1
        with use_threads(threads):
            for step in self.steps:
                given = read_only(result)
                begin = time.perf_counter()
                result = filtered(step, given, warnings)
                if observer is not None:
                    observer(step, time.perf_counter() - begin)
        keeps_start = result.size == grid_map.size and not any(
            isinstance(step.filter, BufferNormalizer) for step in self.steps
        )
        return read_only(result), grid_map.start_index if keeps_start else (0, 0)

    def on_tiles(
        self,
        site: "TiledMap",
        *,
        max_hole: int | None = None,
        large_holes: Literal["refuse", "leave"] = "refuse",
    ) -> "FilteredTiles":
        """Return the filtered layers of a tiled map, which are computed when they are read.

        `TiledMap.filter` calls this. The numbers are those of the chain on the whole map. `threads`
        has no effect: tiles run side by side.

        Args:
            site: the map.
            max_hole: length of the largest hole that `Inpaint` fills, along rows or columns
                [cells]; by default the longer side of a tile.
            large_holes: "refuse" raises an error before the first tile if `Inpaint` should fill a
                longer hole; "leave" leaves it as it is.

        Raises:
            FilterError: a filter needs the whole map, or the chain fails on a small map of zeros;
                the message names the filter.
        """
        from ._tiles import filtered_tiles

        longest = max(site.tile) if max_hole is None else max_hole
        options = TileOptions(max_hole=longest, large_holes=large_holes)
        return filtered_tiles(self.steps, site, options)

    def reach(self, resolution: float) -> float:
        """Return how far the chain looks: the sum of the reaches of its filters [cells].

        A cell of the result depends on the cells of the input that are at most this number of rows
        and columns away, up to rounding: some filters compute with differences to a typical value
        of the layer. It is `WHOLE_MAP` if a filter looks at the whole map.

        Args:
            resolution: side of a cell [m].

        Raises:
            FilterError: a filter gives no number of cells; the message names it.
        """
        return sum(step.reach(resolution) for step in self.steps)

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        return f"FilterChain({', '.join(step.config.name for step in self.steps)})"


def _opencv_keepsread_only() -> bool:
    """Return whether OpenCV refuses to write into a read-only array; OpenCV 4.6 does not."""
    array = np.zeros((1, 1), np.float32)
    array.flags.writeable = False
    try:
        cv2.blur(array, (1, 1), dst=array)
    except cv2.error:
        return True
    return False


OPENCV_KEEPS_READ_ONLY = _opencv_keepsread_only()
"""If False, a call works on a copy, since a filter could change the caller's map unnoticed."""


def _build(config: StepConfig) -> Filter:
    try:
        cls: Any = FILTERS[config.type]
        made: Any = None
        if isinstance(cls, type) and is_dataclass(cls):
            made = build(cls, config.params)
        if not callable(made):
            raise FilterConfigError(f"expected a dataclass that can be called, got {cls!r}")
        for field in fields(made):
            if field.name.endswith("_layer") and field.default is MISSING:
                value = getattr(made, field.name)
                check(value != "", field.name, "the name of a layer", value)
    # The message must name the filter; classes of other packages may raise anything.
    except Exception as error:
        raise FilterConfigError(f"{config}: {message_of(error)}") from error
    return cast(Filter, made)


def describe_parameters(config: Mapping[str, Any]) -> dict[str, str]:
    """Return descriptions of the parameters of a chain, by name: `filter1.params.radius`.

    Parameters that no filter has are left out.
    """
    found: dict[str, str] = {}
    for key, step in config.items():
        if not isinstance(step, Mapping):
            continue
        found |= {f"{key}.{part}": f"{part} of {key}" for part in ("name", "type")}
        try:
            meanings = descriptions(FILTERS[str(step.get("type"))])
        except ConfigError:
            continue
        for name in _names_in(step.get("params")):
            if (field := field_name(name)) in meanings:
                found[f"{key}.params.{name}"] = meanings[field]
    return found


def _names_in(params: object) -> Iterator[str]:
    """Yield the names of all values, those in mappings with dots: `min.color`."""
    for name, value in params.items() if isinstance(params, Mapping) else ():
        inner = [f"{name}.{below}" for below in _names_in(value)]
        yield from inner or [str(name)]


def read_only(grid_map: GridMap) -> GridMap:
    """Return a map with views of the layers that cannot be written into."""
    views = {name: grid_map[name].view() for name in grid_map}
    for view in views.values():
        view.flags.writeable = False
    return grid_map.with_layers(views)


def own_layer(layer: Layer, taken: set[int]) -> Layer:
    """Return a read-only layer as a writeable one, copied if its memory is not its own.

    Args:
        layer: its memory is that of an array of a filter, or of the input.
        taken: addresses of memory that belongs to the input or to other layers; grows.
    """
    own = layer.view()
    try:
        own.flags.writeable = _address(layer) not in taken
    except ValueError:  # The filter returned an array that is read-only.
        own.flags.writeable = False
    taken.add(_address(layer))
    return own if own.flags.writeable else layer.copy("F")


def _address(layer: Layer) -> int:
    return int(layer.__array_interface__["data"][0])


def filtered(step: Step, grid_map: GridMap, warnings: list[str] | None) -> GridMap:
    """Return the map after a step, in map order.

    Raises:
        FilterError: the filter failed; the message names it.
    """
    try:
        with running(step.config, warnings):
            result = step.filter(grid_map)
    except Exception as error:
        message = message_of(error)
        if isinstance(error, ValueError) and "read-only" in str(error):
            message = (
                f"it writes into a layer of its input ({error}); "
                "change a copy and return `grid_map.with_layers({name: copy})`"
            )
        raise FilterError(f"{step.config}: {message}") from error
    if not isinstance(result, GridMap):
        raise FilterError(f"{step.config}: gave {result!r} instead of a GridMap")
    # A filter may move its map, but the next filter expects map order.
    return result if result.start_index == (0, 0) else result.with_start_index((0, 0))


def message_of(error: Exception) -> str:
    """Return the text of an error; for errors of other packages it begins with their type."""
    return str(error) if isinstance(error, GridMapError) else f"{type(error).__name__}: {error}"
