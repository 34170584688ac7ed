# SPDX-License-Identifier: BSD-3-Clause
"""Finds holes in layers: groups of missing cells that touch, even at corners or across tiles."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py._arrays import Mask, Size, max_of_finites, min_of_finites

Integers = npt.NDArray[np.integer[Any]]


@dataclass(frozen=True)
class Holes:
    """Bounding boxes and areas of holes.

    Args:
        starts: (n, 2) first row and column of each hole.
        ends: (n, 2) last row and column of each hole, plus 1.
        areas: (n,) number of cells of each hole.
    """

    starts: Integers
    ends: Integers
    areas: Integers

    @property
    def lengths(self) -> Integers:
        """(n,) longer side of the bounding box of each hole [cells]."""
        return np.asarray((self.ends - self.starts).max(axis=1, initial=0))

    def touch_border(self, size: Size) -> Mask:
        return np.asarray(((self.starts == 0) | (self.ends == size)).any(axis=1))

    def moved(self, shift: Size) -> "Holes":
        """Return the holes shifted by a number of rows and columns."""
        return Holes(self.starts + shift, self.ends + shift, self.areas)

    def __getitem__(self, which: Any) -> "Holes":
        return Holes(self.starts[which], self.ends[which], self.areas[which])


def find_holes(missing: Mask) -> tuple[Integers, Holes]:
    """Return the hole number of each cell (rows, cols), and the holes of a layer.

    Holes are numbered from 1. The number 0 means no hole.
    """
    # Map rows run along the x axis of the image.
    image = np.ascontiguousarray(missing.T).view(np.uint8)
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(image, connectivity=8)
    found = np.asarray(boxes[1:], np.int64)
    starts = found[:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]]
    lengths = found[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]]
    holes = Holes(starts, starts + lengths, found[:, cv2.CC_STAT_AREA])
    return np.asarray(labels.T, np.int32), holes


def place_of(tile: GridMap, whole: GridGeometry) -> Size:
    """Return the row and column in the whole map at which a tile begins."""
    return whole.cell_at(tile.geometry.center_of((0, 0))) or (0, 0)


class HolesOfTile(NamedTuple):
    """Holes in one tile; input of `merged`.

    Args:
        lowest, highest: smallest and largest finite value; NaN if there are none.
        holes: long holes and holes at the tile border, with rows and columns of the whole map.
        edges: (n,) hole numbers along the first row, last row, first column and last column.
    """

    lowest: float
    highest: float
    holes: Holes
    edges: tuple[Integers, ...]


@dataclass(frozen=True)
class FindHoles:
    """Callable that finds the holes of a layer in a tile.

    Holes up to `length` [cells] are omitted, unless they touch the tile border.
    """

    layer: str
    whole: GridGeometry
    length: float

    def __call__(self, tile: GridMap) -> HolesOfTile:
        layer = tile[self.layer]
        labels, holes = find_holes(~np.isfinite(layer))
        kept = holes.touch_border(tile.size) | (holes.lengths > self.length)
        numbers = np.append(0, np.cumsum(kept) * kept).astype(np.int32)
        edges = tuple(
            numbers[edge] for edge in (labels[0], labels[-1], labels[:, 0], labels[:, -1])
        )
        moved = holes[kept].moved(place_of(tile, self.whole))
        return HolesOfTile(min_of_finites(layer), max_of_finites(layer), moved, edges)


def merged(tiles: Sequence[HolesOfTile], counts: Size) -> Holes:
    """Merge the holes of all tiles, listed row by row, into the holes of the whole map."""
    from scipy.sparse import coo_matrix  # slow to import
    from scipy.sparse.csgraph import connected_components

    parts = [tile.holes for tile in tiles]
    firsts = np.cumsum([0, *(len(part.areas) for part in parts)])
    numbers = np.arange(len(tiles)).reshape(counts)
    pairs = [np.empty((2, 0), np.int64)]

    def shifted(tile: int, side: int) -> Integers:
        """Convert the hole numbers along a tile edge to numbers that are unique in the map."""
        edge = tiles[tile].edges[side]
        return np.where(edge > 0, edge + firsts[tile], 0)

    for lines, sides in ((numbers, (1, 0)), (numbers.T, (3, 2))):
        for both in pairwise(lines):
            # Hole numbers on both sides of the border between two lines of tiles.
            last, first = (
                np.concatenate([shifted(n, side) for n in line])
                for line, side in zip(both, sides, strict=True)
            )
            # A hole may continue straight or diagonally across the border.
            for one, other in ((last, first), (last[1:], first[:-1]), (last[:-1], first[1:])):
                touch = (one > 0) & (other > 0)
                pairs.append(np.stack([one[touch], other[touch]]))
    pair = tuple(np.concatenate(pairs, axis=1))
    graph = coo_matrix((np.ones(len(pair[0])), pair), shape=(firsts[-1] + 1,) * 2)
    # Node 0 stands for the cells outside holes.
    count, groups = connected_components(graph, directed=False)
    of_part = groups[1:] - 1
    starts = np.full((count - 1, 2), np.iinfo(np.int64).max)
    ends, areas = np.zeros((count - 1, 2), np.int64), np.zeros(count - 1, np.int64)
    np.minimum.at(starts, of_part, np.concatenate([part.starts for part in parts]))
    np.maximum.at(ends, of_part, np.concatenate([part.ends for part in parts]))
    np.add.at(areas, of_part, np.concatenate([part.areas for part in parts]))
    return Holes(starts, ends, areas)
