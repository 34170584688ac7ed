# SPDX-License-Identifier: BSD-3-Clause
"""Values of a tiled map at positions: only cells around the positions are read."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from .._arrays._checks import Integers, Positions, as_positions, select_layers
from ..map._interpolation import REACH, Interpolation, Surface, check_inside, method_of
from ._engine import in_any_order
from ._source import Window, widened
from ._tiled_map import TiledMap


@dataclass(frozen=True, eq=False)
class _Part:
    """Positions in one tile, and the cells that their values depend on."""

    chosen: Integers
    points: Positions
    window: Window


def at(
    site: TiledMap, positions: ArrayLike, layer: str, interpolation: Interpolation | str
) -> float | Positions:
    """Return values of a layer at positions; see `TiledMap.at`."""
    select_layers(site.layers, (layer,))
    read = partial(_values, site, layer, method_of(interpolation))
    points = as_positions(positions)
    parts = _parts(site, points.reshape(-1, 2))
    site.source.prepare()
    values = np.empty(points.size // 2)
    # For one part, the scheduler takes longer than reading.
    found = in_any_order(read, parts) if len(parts) > 1 else ((part, read(part)) for part in parts)
    for part, of_part in found:
        values[part.chosen] = of_part
    return float(values[0]) if points.ndim == 1 else values.reshape(points.shape[:-1])


def _parts(site: TiledMap, points: Positions) -> list[_Part]:
    """Return the positions (N, 2) tile by tile; raise if one is not on the map."""
    check_inside(site.geometry, points)
    cells, _ = site.geometry.cells_at(points)
    tiles = cells[0] // site.tile[0] * site.tiles.counts[1] + cells[1] // site.tile[1]
    order = np.argsort(tiles, kind="stable")
    borders = np.flatnonzero(np.diff(tiles[order])) + 1
    parts = []
    for chosen in np.split(order, borders) if order.size else ():
        rows, columns = (
            slice(int(numbers[chosen].min()), int(numbers[chosen].max()) + 1) for numbers in cells
        )
        window = widened((rows, columns), REACH, site.size)
        parts.append(_Part(chosen, points[chosen], window))
    return parts


def _values(site: TiledMap, layer: str, method: Interpolation, part: _Part) -> Positions:
    (cells,) = site.source.read(part.window, [layer])
    corner = part.window[0].start, part.window[1].start
    return Surface(site.geometry, (0, 0), cells, corner).at(part.points, method)
