# SPDX-License-Identifier: BSD-3-Clause
"""Filter chains for maps in memory and for tiled maps."""

import math
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Size
from grid_map_core_py._parameters import descriptions
from grid_map_core_py.errors import ConfigError, short
from grid_map_core_py.tiled import TiledMap

from ._builtin._buffer_normalizer import BufferNormalizer
from ._config import field_name, parse_steps, read_chain
from ._filter import TileOptions, check_map
from ._registry import FILTERS
from ._step import Step, StepObserver, address_of, own_layer, read_only
from ._tiles import FilteredTiles, filtered_tiles
from .errors import FilterConfigError
from .parts._side_by_side import use_threads

_FEWEST_CELLS = 1000**2
"""Maps with fewer cells are filtered by one thread, because waking other threads takes too long."""

_MOST_THREADS = 1000
"""Maximum number of threads; a chain starts all its threads, even if some get no work."""


class FilterChain:
    """Sequence of filters that run one after the other.

    `chain(grid_map)` does not change `grid_map`, and the result shares no data with it. The result
    has the start index of the input, unless the chain contains a `BufferNormalizer` or changes the
    size. Several threads may call a chain at the same time.

    The layers that a filter receives are read-only. Writing to them raises an error.

    Args:
        steps: filters in execution order.
        threads: maximum number of threads, from 1 to 1000. Small maps use one thread. Results do
            not depend on the number of threads.

    Raises:
        FilterConfigError: `threads` is not an integer from 1 to 1000, or `steps` contains an object
            that is not a `Step`.

    Example:
        >>> chain = FilterChain.from_config([{
        ...     "name": "roughness", "type": "gridMapFilters/MathExpressionFilter",
        ...     "params": {"expression": "abs(raw - smooth)", "output_layer": "roughness"}}])
        >>> rough = chain(GridMap((1, 1), 0.5, layers={"raw": 1.0, "smooth": 1.5}))
        >>> float(rough["roughness"][0, 0])
        0.5
    """

    def __init__(self, steps: Iterable[Step], *, threads: int = 1) -> None:
        is_integer = isinstance(threads, int) and not isinstance(threads, bool)
        if not (is_integer and 1 <= threads <= _MOST_THREADS):
            expected = f"an integer from 1 to {_MOST_THREADS}"
            raise FilterConfigError(f"threads: expected {expected}, got {short(threads)}")
        self.steps = tuple(steps)
        if others := [each for each in self.steps if not isinstance(each, Step)]:
            remedy = "FilterChain.from_config makes steps of types and parameters"
            raise FilterConfigError(f"steps: expected Step objects, got {others[0]!r}. {remedy}")
        self.threads = threads

    @classmethod
    def from_config(cls, config: object, *, threads: int = 1) -> "FilterChain":
        """Create a chain from its configuration, as stored under `filters:` in a YAML file.

        The configuration is a mapping with the keys `filter1`, `filter2`, ..., or a list. Each item
        is a mapping with the keys `name`, `type` and `params`.

        Raises:
            FilterConfigError: the chain is invalid; the message names filter, type and parameter.
        """
        return cls(map(Step.from_config, parse_steps(config)), threads=threads)

    @classmethod
    def from_yaml(
        cls, path: str | Path, name: str = "filters", *, threads: int = 1
    ) -> "FilterChain":
        """Create a chain from a ROS 2 or ROS 1 parameter file, or from a YAML list of filters.

        Args:
            path: path of the YAML file.
            name: name of the parameter that contains the chain.
            threads: see `FilterChain`.

        Raises:
            FilterConfigError: the file cannot be read, or the chain is invalid; the message names
                filter, type and parameter.
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
            grid_map: map to filter; not changed.
            observer: called after each step with the step and its duration [s].
            warnings: list to which the warnings of filters are appended. If None, each warning is
                issued as a `FilterWarning`.

        Raises:
            FilterError: a filter failed; the message names the filter.
        """
        result, start = self.without_copies(grid_map, observer, warnings=warnings)
        if start != (0, 0):
            return result.with_start_index(start)
        taken = {address_of(grid_map[name]) for name in grid_map}
        return result.with_layers({name: own_layer(result[name], taken) for name in result})

    def without_copies(
        self,
        grid_map: GridMap,
        observer: StepObserver | None = None,
        *,
        warnings: list[str] | None = None,
    ) -> tuple[GridMap, Size]:
        """Return the filtered map in map order, that is, with start index (0, 0).

        Nodes use this method to write the result directly into a message. The second returned value
        is the start index that the result of `__call__` would have. All layers are read-only. If
        the input is also in map order, unchanged layers share memory with the input. See `__call__`
        for arguments and errors.
        """
        check_map(grid_map)
        result = grid_map
        if grid_map.start_index != (0, 0):
            result = grid_map.with_start_index((0, 0))
        threads = self.threads if math.prod(grid_map.size) >= _FEWEST_CELLS else 1
        with use_threads(threads):
            for step in self.steps:
                given = read_only(result)
                begin = time.perf_counter()
                result = step(given, warnings)
                if observer is not None:
                    observer(step, time.perf_counter() - begin)
        keeps_start = result.size == grid_map.size and not any(
            isinstance(step.filter, BufferNormalizer) for step in self.steps
        )
        return read_only(result), grid_map.start_index if keeps_start else (0, 0)

    def on_tiles(
        self,
        tiled_map: TiledMap,
        *,
        max_hole: int | None = None,
        large_holes: Literal["refuse", "leave"] = "refuse",
    ) -> FilteredTiles:
        """Return the filtered layers of a tiled map, computed on demand.

        `TiledMap.filter` calls this method. The values equal the result of the chain for the whole
        map, up to rounding. The `threads` of the chain have no effect, because tiles are computed
        in parallel.

        Args:
            tiled_map: map to filter.
            max_hole: maximum length of the holes that `Inpaint` fills, along rows or columns
                [cells]; the longer side of a tile by default.
            large_holes: treatment of longer holes, if `Inpaint` would fill them. "refuse": an error
                is raised before the first tile is computed. "leave": these holes stay unfilled.

        Raises:
            FilterError: a filter needs the whole map, or fails in a trial run on a small map of
                zeros. The message names the filter.
        """
        longest = max(tiled_map.tile) if max_hole is None else max_hole
        options = TileOptions(max_hole=longest, large_holes=large_holes)
        return filtered_tiles(self.steps, tiled_map, options)

    def reach(self, resolution: float) -> float:
        """Return the reach of the chain [cells]: the sum of all filter reaches.

        A cell of the result depends only on input cells that are at most this number of rows and
        columns away. Rounding errors may also depend on other cells, because some filters subtract
        a typical value of the layer. The reach is `WHOLE_MAP` if a filter needs the whole map.

        Args:
            resolution: side of a cell [m].

        Raises:
            FilterError: the `reach` of a filter is invalid; the message names the filter.
        """
        return sum(step.reach(resolution) for step in self.steps)

    def __len__(self) -> int:
        return len(self.steps)

    def __repr__(self) -> str:
        return f"FilterChain({', '.join(step.config.name for step in self.steps)})"


def describe_parameters(config: Mapping[str, Any]) -> dict[str, str]:
    """Return parameter descriptions by parameter name, such as `filter1.params.radius`."""
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
    """Yield all parameter names; nested names are joined with dots, as in `min.color`."""
    for name, value in params.items() if isinstance(params, Mapping) else ():
        inner = [f"{name}.{below}" for below in _names_in(value)]
        yield from inner or [str(name)]
