# SPDX-License-Identifier: BSD-3-Clause
"""Chains on tiled maps: a window of the result is computed from a wider window of the input.

Each step asks the one before it for its window with a border as wide as its filter looks, and only
for the layers that it needs. A step whose results nobody asked for does not run.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py.tiled import TiledMap, Window, shape, widened, within

from ._chain import Step, filtered, message_of, own_layer, read_only
from ._filter import WHOLE_MAP, Filter, TileOptions, for_tiles_of, pass_on, reach_of, running
from ._registry import BUILT_IN
from .errors import FilterError

_CORNER = 3
"""Side of the small map on which a chain is tried [cells]."""

_MOST = 1.05
"""Cells of the largest map that is not cropped, in cells that are wanted."""


@dataclass(frozen=True)
class _TileStep:
    """A step of a chain on tiles.

    Args:
        step: the filter and its configuration.
        reads: layers of its input that it looks at.
        writes: layers of its result that are new or changed.
        layers: all layers of its result.
        basic_layers: basic layers of its result.
    """

    step: Step
    reads: frozenset[str]
    writes: frozenset[str]
    layers: tuple[str, ...]
    basic_layers: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class FilteredTiles:
    """Layers of a tiled map after the steps of a chain; see `FilterChain.on_tiles`."""

    site: TiledMap
    steps: tuple[_TileStep, ...]
    options: TileOptions
    _bound: dict[int, Filter] = field(default_factory=dict, repr=False)
    """Filters for tiles by the number of their step, with quantities of the whole map put in."""

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers in their order."""
        return self.steps[-1].layers if self.steps else self.site.layers

    @property
    def basic_layers(self) -> tuple[str, ...]:
        """Names of the basic layers."""
        return self.steps[-1].basic_layers if self.steps else self.site.basic_layers

    def describe(self) -> str:
        configs = [step.step.config for step in self.steps]
        texts = [f"{config.type} {sorted(config.params.items())}" for config in configs]
        return "\n".join([self.site.source.describe(), *texts, repr(self.options)])

    def prepare(self) -> None:
        self.site.source.prepare()
        for number, step in enumerate(self.steps):
            if number not in self._bound:
                before = replace(self, steps=self.steps[:number])
                site = replace(self.site, source=before, basic_layers=before.basic_layers)
                self._bound[number] = _bound(step.step, site, self.options)

    def read(self, window: Window, names: Sequence[str]) -> list[Layer]:
        self.prepare()
        result, around = self._block(len(self.steps), window, frozenset(names))
        inner, taken = within(window, around), set[int]()
        return [
            own_layer(result[name], taken) if around == window else result[name][inner].copy("F")
            for name in names
        ]

    def _block(self, count: int, window: Window, names: frozenset[str]) -> tuple[GridMap, Window]:
        """Return a window after the first `count` steps, with the named layers.

        Returns:
            The map of a window, and this window: the wanted one, or one that is little larger. It
            is not cropped, since all layers would be copied. Cells beside the wanted ones are
            those of a map that ends there.
        """
        while count and not self.steps[count - 1].writes & names:
            count -= 1
        if not count:
            return self._input(window, names), window
        step, function = self.steps[count - 1], self._bound[count - 1]
        needed = (names - step.writes) | step.reads
        border, size = reach_of(function, self.site.resolution), self.site.size
        missing = getattr(function, "missing", None)
        while True:
            wanted = widened(window, int(min(border, max(size))), size)
            given, around = self._block(count - 1, wanted, needed)
            if callable(missing) or _cells(around) > _MOST * _cells(wanted):
                given, around = _cropped(given, within(wanted, around)), wanted
            more = missing(given, within(window, around)) if callable(missing) else 0
            if not more:
                break
            border += more
        result = filtered(replace(step.step, filter=function), read_only(given), None)
        return result.without_layers(name for name in result if name not in names), around

    def _input(self, window: Window, names: frozenset[str]) -> GridMap:
        site, wanted = self.site, [name for name in self.site.layers if name in names]
        layers = dict(zip(wanted, site.source.read(window, wanted), strict=True))
        return _map(site, window, layers)


def _map(site: TiledMap, window: Window, layers: Mapping[str, Layer | float]) -> GridMap:
    """Return a window of a map, with layers that are not copied."""
    geometry = site.geometry.cropped(*window)
    frame, time = site.frame_id, site.timestamp
    grid_map = GridMap.from_geometry(geometry, frame_id=frame, timestamp=time).with_layers(layers)
    grid_map.basic_layers = [name for name in site.basic_layers if name in layers]
    return grid_map


def _cropped(grid_map: GridMap, window: Window) -> GridMap:
    """Return a window of a map, with layers of its own."""
    return grid_map if shape(window) == grid_map.size else grid_map.get_block(*window)


def _cells(window: Window) -> int:
    return math.prod(shape(window))


def filtered_tiles(steps: Iterable[Step], site: TiledMap, options: TileOptions) -> FilteredTiles:
    """Return the layers of a tiled map after some steps; see `FilterChain.on_tiles`.

    The chain runs on a small map of zeros, so that a missing layer or a wrong chain is an error
    before any data is read.
    """
    rows, columns = (slice(0, min(length, _CORNER)) for length in site.size)
    grid_map = _map(site, (rows, columns), dict.fromkeys(site.layers, 0.0))
    tried, warnings = list[_TileStep](), list[str]()
    for step in steps:
        _check(step, grid_map, site.resolution)
        grid_map, new = _try(step, grid_map, warnings)
        tried.append(new)
    pass_on(warnings, None, stacklevel=4)
    return FilteredTiles(site, tuple(tried), options)


def _check(step: Step, grid_map: GridMap, resolution: float) -> None:
    """Raise a FilterError if a filter needs the whole map."""
    explain = getattr(step.filter, "why_whole_map", None)
    reason = explain(grid_map) if callable(explain) else ""
    can_be_bound = callable(getattr(step.filter, "for_tiles_of", None))
    if not reason and (can_be_bound or step.reach(resolution) < WHOLE_MAP):
        return
    reason = reason or (
        "it may look at all cells; if it looks less far, declare how far by a method "
        "`reach(resolution)` that returns a number of cells"
    )
    raise FilterError(f"{step.config}: cannot run on tiles: {reason}")


def _try(step: Step, grid_map: GridMap, warnings: list[str]) -> tuple[GridMap, _TileStep]:
    """Run a step on a small map; return its result, and what the step reads and writes."""
    given = _Watched.of(grid_map)
    result = filtered(step, given, warnings)
    looked_at = frozenset(given.looked_at & {*grid_map})
    if result.geometry != grid_map.geometry:
        raise FilterError(f"{step.config}: cannot run on tiles: it changes the grid of the map")
    writes = frozenset(
        name for name in result if name not in grid_map or result[name] is not given[name]
    )
    if type(step.filter) not in BUILT_IN.values():
        # What it looks at, and changes, may depend on the data.
        looked_at, writes = frozenset(grid_map), frozenset(result)
    return result, _TileStep(step, looked_at, writes, result.layers, result.basic_layers)


class _Watched(GridMap):
    """A map that records the names of layers that a filter looks at, or looks for."""

    __slots__ = ("looked_at",)
    looked_at: set[str]

    @classmethod
    def of(cls, grid_map: GridMap) -> "_Watched":
        """Return a copy of a map, with layers that are read-only."""
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


def _bound(step: Step, site: TiledMap, options: TileOptions) -> Filter:
    """Return the filter of a step for the tiles of the map before it."""
    try:
        with running(step.config, None):
            function = for_tiles_of(step.filter, site, options)
            if reach_of(function, site.resolution) < WHOLE_MAP:
                return function
    # Classes of other packages may raise anything.
    except Exception as error:
        raise FilterError(f"{step.config}: {message_of(error)}") from error
    expected = "a filter whose reach is a number of cells"
    raise FilterError(f"{step.config}: for_tiles_of: expected {expected}, got {function!r}")
