# SPDX-License-Identifier: BSD-3-Clause
"""Runs filter chains on tiled maps, window by window.

For a window of the result, each step requests a window from the previous step that is wider by the
reach of its filter. Only necessary layers and steps are computed.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py.tiled import TiledMap
from grid_map_core_py.tiled._source import Window, shape, widened, within

from ._filter import (
    WHOLE_MAP,
    Filter,
    GlobalFilter,
    PartlyLocalFilter,
    TileOptions,
    WideningFilter,
    pass_on,
    reach_of,
    running,
)
from ._registry import BUILT_IN
from ._step import Step, message_of, own_layer, read_only
from .errors import FilterError

_CORNER = 3
"""Side length of the small map that is used for a trial run of the chain [cells]."""

_MOST = 1.05
"""A map is cropped only if it has more than this number of times the requested cells."""


@dataclass(frozen=True)
class _TileStep:
    """One step of a chain on tiles, with the names of its input and output layers."""

    step: Step
    reads: frozenset[str]
    writes: frozenset[str]
    layers: tuple[str, ...]
    basic_layers: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class FilteredTiles:
    """Source of the layers of a filtered tiled map; see `FilterChain.on_tiles`."""

    tiled_map: TiledMap
    steps: tuple[_TileStep, ...]
    options: TileOptions
    _bound: dict[int, Filter] = field(default_factory=dict, repr=False)
    """Filters prepared for tiles, by step number; quantities of the whole map are precomputed."""

    @property
    def layers(self) -> tuple[str, ...]:
        """Layer names, in order."""
        return self.steps[-1].layers if self.steps else self.tiled_map.layers

    @property
    def basic_layers(self) -> tuple[str, ...]:
        """Names of the basic layers."""
        return self.steps[-1].basic_layers if self.steps else self.tiled_map.basic_layers

    def describe(self) -> str:
        configs = [step.step.config for step in self.steps]
        texts = [f"{config.type} {sorted(config.params.items())}" for config in configs]
        return "\n".join([self.tiled_map.source.describe(), *texts, repr(self.options)])

    def prepare(self) -> None:
        self.tiled_map.source.prepare()
        for number, step in enumerate(self.steps):
            if number in self._bound:
                continue
            function, config = step.step.filter, step.step.config
            before = replace(self, steps=self.steps[:number])
            given = replace(self.tiled_map, source=before, basic_layers=before.basic_layers)
            try:
                with running(config, None):
                    if isinstance(function, GlobalFilter):
                        function = function.for_tiles_of(given, self.options)
                    if reach_of(function, given.resolution) == WHOLE_MAP:
                        expected = "a filter whose reach is a number of cells"
                        raise FilterError(f"for_tiles_of: expected {expected}, got {function!r}")
            # Filter classes of other packages may raise any exception.
            except Exception as error:
                raise FilterError(f"{config}: {message_of(error)}") from error
            self._bound[number] = function

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        self.prepare()
        result, around = self._block(len(self.steps), window, frozenset(names))
        inner, taken = within(window, around), set[int]()
        return [
            own_layer(result[name], taken) if around == window else result[name][inner].copy("F")
            for name in names
        ]

    def _block(self, count: int, window: Window, names: frozenset[str]) -> tuple[GridMap, Window]:
        """Compute the layers `names` of a window after the first `count` steps.

        The returned window may be larger than requested. Its additional cells may be wrong.
        """
        while count and not self.steps[count - 1].writes & names:
            count -= 1
        if not count:
            wanted_layers = [name for name in self.tiled_map.layers if name in names]
            return self.tiled_map.get_block(*window, wanted_layers), window
        step, function = self.steps[count - 1], self._bound[count - 1]
        needed = (names - step.writes) | step.reads
        border, size = reach_of(function, self.tiled_map.resolution), self.tiled_map.size
        while True:
            wanted = widened(window, int(min(border, max(size))), size)
            given, around = self._block(count - 1, wanted, needed)
            most = 1.0 if isinstance(function, WideningFilter) else _MOST
            if math.prod(shape(around)) > most * math.prod(shape(wanted)):
                given, around = given.get_block(*within(wanted, around)), wanted
            more = 0
            if isinstance(function, WideningFilter):
                more = function.missing(given, within(window, around))
            if not more:
                break
            border += more
        result = replace(step.step, filter=function)(read_only(given), None)
        return result.without_layers(name for name in result if name not in names), around


def filtered_tiles(
    steps: Iterable[Step], tiled_map: TiledMap, options: TileOptions
) -> FilteredTiles:
    """Apply the steps of a chain to a tiled map; see `FilterChain.on_tiles`."""
    rows, columns = (slice(0, min(length, _CORNER)) for length in tiled_map.size)
    grid_map = GridMap.from_geometry(
        tiled_map.geometry.cropped(rows, columns),
        dict.fromkeys(tiled_map.layers, 0.0),
        basic_layers=tiled_map.basic_layers,
        frame_id=tiled_map.frame_id,
        timestamp=tiled_map.timestamp,
    )
    tried, warnings = list[_TileStep](), list[str]()
    for step in steps:
        reason = ""
        if isinstance(step.filter, PartlyLocalFilter):
            reason = step.filter.why_whole_map(grid_map)
        is_global = isinstance(step.filter, GlobalFilter)
        if not (reason or is_global or step.reach(tiled_map.resolution) < WHOLE_MAP):
            reason = (
                "it may look at all cells; if it looks less far, declare how far with a method "
                "`reach(resolution)` that returns a number of cells"
            )
        if reason:
            raise FilterError(f"{step.config}: cannot run on tiles: {reason}")
        given = _Watched.of(grid_map)
        result = step(given, warnings)
        reads = frozenset(given.looked_at & {*grid_map})
        if result.geometry != grid_map.geometry:
            raise FilterError(f"{step.config}: cannot run on tiles: it changes the grid of the map")
        writes = frozenset(
            name for name in result if name not in grid_map or result[name] is not given[name]
        )
        if type(step.filter) not in BUILT_IN.values():
            # The data may determine which layers an external filter reads and changes.
            reads, writes = frozenset(grid_map), frozenset(result)
        tried.append(_TileStep(step, reads, writes, result.layers, result.basic_layers))
        grid_map = result
    pass_on(warnings, None, stacklevel=4)
    return FilteredTiles(tiled_map, tuple(tried), options)


class _Watched(GridMap):
    """Map that records which layers a filter reads or looks up."""

    __slots__ = ("looked_at",)
    looked_at: set[str]

    @classmethod
    def of(cls, grid_map: GridMap) -> "_Watched":
        """Return a copy of a map with read-only layers."""
        watched = cls.from_geometry(
            grid_map.geometry,
            grid_map,
            basic_layers=grid_map.basic_layers,
            frame_id=grid_map.frame_id,
            timestamp=grid_map.timestamp,
        )
        assert isinstance(watched, cls)
        watched.looked_at = set()
        for layer in watched.values():
            layer.flags.writeable = False
        watched.looked_at.clear()
        return watched

    def __getitem__(self, layer: str) -> Layer:
        self.looked_at.add(layer)
        return super().__getitem__(layer)

    def __contains__(self, layer: object) -> bool:
        self.looked_at.add(str(layer))
        return super().__contains__(layer)
