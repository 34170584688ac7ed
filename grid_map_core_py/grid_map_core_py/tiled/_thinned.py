# SPDX-License-Identifier: BSD-3-Clause
"""Every n-th cell of a tiled map, in bounded memory and time."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Layer
from ..limits import check_cells
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..plugins import check
from ._engine import in_any_order
from ._rasters import overview_of
from ._source import Window

if TYPE_CHECKING:
    from ._tiled_map import TiledMap

_MOST_TILES = 4096
"""Maximum number of tiles that are read, which takes about half a minute."""


def thinned_map(tiled_map: "TiledMap", step: int, names: Sequence[str]) -> GridMap:
    """Return every `step`-th cell of a map; see `TiledMap.thinned`."""
    check(step >= 1, "step", "a number of cells", step)
    tiled_map, factor = overview_of(tiled_map, step)
    step = _affordable(tiled_map, math.ceil(step / factor))
    first = step // 2
    lines = [np.arange(min(first, size - 1), size, step) for size in tiled_map.size]
    size = len(lines[0]), len(lines[1])
    check_cells("thinned map", size, len(names))
    begin = tiled_map.geometry.center_of((int(lines[0][0]), int(lines[1][0])))
    resolution = step * tiled_map.resolution
    center = np.subtract(begin, 0.5 * resolution * (np.array(size) - 1))
    geometry = GridGeometry.from_size(size, resolution, center)
    layers = [np.full(size, np.nan, np.float32, order="F") for _ in names]
    tiled_map.source.prepare()
    blocks = _blocks(tiled_map, lines)
    for place, block in in_any_order(_Read(tiled_map, step, names), blocks):
        target = tuple(
            slice(*np.searchsorted(line, (part.start, part.stop)))
            for line, part in zip(lines, place, strict=True)
        )
        for layer, values in zip(layers, block, strict=True):
            layer[target] = values
    return tiled_map._map(geometry, names, layers)


def _affordable(tiled_map: "TiledMap", step: int) -> int:
    """Return a step, as large as given or larger, with which few enough tiles have a cell."""

    def tiles(step: int) -> int:
        counts = [
            min(math.ceil(size / side), math.ceil(size / step))
            for size, side in zip(tiled_map.size, tiled_map.tile, strict=True)
        ]
        return counts[0] * counts[1]

    while tiles(step) > _MOST_TILES:
        step = math.ceil(1.1 * step)
    return step


def _blocks(tiled_map: "TiledMap", lines: Sequence[NDArray[Any]]) -> Any:
    """Yield the tiles that have a cell of the result: windows from its first to its last one."""
    parts = []
    for line, side in zip(lines, tiled_map.tile, strict=True):
        numbers = line // side
        begins = np.flatnonzero(np.diff(numbers, prepend=-1))
        ends = np.append(begins[1:], len(line)) - 1
        parts.append(
            [slice(int(line[a]), int(line[b]) + 1) for a, b in zip(begins, ends, strict=True)]
        )
    return ((rows, columns) for rows in parts[0] for columns in parts[1])


@dataclass(frozen=True)
class _Read:
    """Reads every `step`-th cell of a window, beginning with the first."""

    tiled_map: "TiledMap"
    step: int
    names: Sequence[str]

    def __call__(self, window: Window) -> list[Layer]:
        layers = self.tiled_map.source.read(window, self.names)
        return [np.asfortranarray(layer[:: self.step, :: self.step]) for layer in layers]
