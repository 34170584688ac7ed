# SPDX-License-Identifier: BSD-3-Clause
"""Reads every n-th row and column of a tiled map, with limited memory and time."""

import itertools
import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from .._arrays._checks import Layer
from ..limits import check_cells
from ..map._geometry import GridGeometry
from ..map._grid_map import GridMap
from ..plugins import check
from ._engine import in_any_order
from ._rasters import overview_of
from ._source import Source

if TYPE_CHECKING:
    from ._tiled_map import TiledMap

_MOST_TILES = 4096  # maximum number of tiles to read; reading them takes about half a minute

_Run: TypeAlias = tuple[slice, slice]
"""Slices of the rows (or columns) to read from a tile, and of those to fill in the result."""


def thinned_map(tiled_map: "TiledMap", step: int, names: Sequence[str]) -> GridMap:
    check(step >= 1, "step", "a number of cells", step)
    tiled_map, factor = overview_of(tiled_map, step)
    step, sides = math.ceil(step / factor), [*zip(tiled_map.size, tiled_map.tile, strict=True)]
    while math.prod(math.ceil(size / max(side, step)) for size, side in sides) > _MOST_TILES:
        step = math.ceil(1.1 * step)
    rows, columns = (_runs(size, side, step) for size, side in sides)
    size = rows[-1][1].stop, columns[-1][1].stop
    check_cells("thinned map", size, len(names))
    begin = tiled_map.geometry.center_of((rows[0][0].start, columns[0][0].start))
    resolution = step * tiled_map.resolution
    center = np.subtract(begin, 0.5 * resolution * (np.array(size) - 1))
    layers = [np.full(size, np.nan, np.float32, order="F") for _ in names]
    tiled_map.source.prepare()
    read = partial(_read, tiled_map.source, step, names)
    for (row, column), block in in_any_order(read, itertools.product(rows, columns)):
        for layer, values in zip(layers, block, strict=True):
            layer[row[1], column[1]] = values
    return tiled_map._map(GridGeometry.from_size(size, resolution, center), names, layers)


def _runs(size: int, side: int, step: int) -> list[_Run]:
    """Return a `_Run` for each tile with rows (or columns) to read along an axis."""
    lines = np.arange(min(step // 2, size - 1), size, step)
    begins = np.flatnonzero(np.diff(lines // side, prepend=-1)).tolist()
    return [
        (slice(int(lines[begin]), int(lines[end - 1]) + 1), slice(begin, end))
        for begin, end in itertools.pairwise([*begins, len(lines)])
    ]


def _read(source: Source, step: int, names: Sequence[str], runs: tuple[_Run, _Run]) -> list[Layer]:
    layers = source.read((runs[0][0], runs[1][0]), names)
    return [np.asfortranarray(layer[::step, ::step]) for layer in layers]
