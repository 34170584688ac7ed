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
        lengths: Integers = (self.ends - self.starts).max(axis=1, initial=0)
        return lengths

    def touch_border(self, size: Size) -> Mask:
        """Return an (n,) mask of the holes that touch the map border."""
        touch: Mask = ((self.starts == 0) | (self.ends == size)).any(axis=1)
        return touch

    def moved(self, shift: Size) -> "Holes":
        """Return the holes shifted by a number of rows and columns."""
        return Holes(self.starts + shift, self.ends + shift, self.areas)

    def __getitem__(self, which: Any) -> "Holes":
        return Holes(self.starts[which], self.ends[which], self.areas[which])


def find_holes(missing: Mask) -> tuple[Integers, Holes]:
    """Return the hole number of each cell (rows, cols), and the holes of a layer.

    Holes are numbered from 1. Cells outside holes have the number 0.

    Args:
        missing: (rows, cols) mask of missing cells.
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


class Edge(NamedTuple):
    """Hole numbers along an edge of a tile, stored only for missing cells.

    Args:
        length: number of cells of the edge.
        cells: indices of the missing cells.
        numbers: hole numbers of the missing cells, from 1.
    """

    length: int
    cells: Integers
    numbers: Integers

    @classmethod
    def of(cls, numbers: Integers) -> "Edge":
        """Create an edge from hole numbers (n,), which are 0 outside holes."""
        cells = np.flatnonzero(numbers)
        return cls(len(numbers), cells.astype(np.int32), numbers[cells].astype(np.int32))

    def shifted(self, first: int) -> Integers:
        """Return the hole number plus `first` for each cell of the edge, or 0 outside holes."""
        numbers = np.zeros(self.length, np.int64)
        numbers[self.cells] = self.numbers + np.int64(first)
        return numbers


class HolesOfTile(NamedTuple):
    """Holes in one tile; input of `merged`.

    Args:
        lowest, highest: smallest and largest finite value; NaN if there are none.
        holes: long holes and holes that touch the tile border; rows and columns refer to the whole
            map.
        edges: edges of the tile, in the order first row, last row, first column, last column.
    """

    lowest: float
    highest: float
    holes: Holes
    edges: tuple[Edge, ...]


@dataclass(frozen=True)
class FindHoles:
    """Callable that finds the holes of a layer in a tile.

    Args:
        layer: name of the layer.
        whole: geometry of the whole map.
        length: largest length of omitted holes [cells]; holes at the tile border are never omitted.
    """

    layer: str
    whole: GridGeometry
    length: float

    def __call__(self, tile: GridMap) -> HolesOfTile:
        layer = tile[self.layer]
        labels, holes = find_holes(~np.isfinite(layer))
        kept = holes.touch_border(tile.size) | (holes.lengths > self.length)
        numbers = np.append(0, np.cumsum(kept) * kept)
        edges = tuple(
            Edge.of(numbers[edge]) for edge in (labels[0], labels[-1], labels[:, 0], labels[:, -1])
        )
        moved = holes[kept].moved(place_of(tile, self.whole))
        return HolesOfTile(min_of_finites(layer), max_of_finites(layer), moved, edges)


def merged(tiles: Sequence[HolesOfTile], counts: Size) -> Holes:
    """Merge the holes of all tiles into the holes of the whole map.

    Args:
        tiles: holes of the tiles, row by row.
        counts: number of rows and number of columns in the grid of tiles.
    """
    parts = [tile.holes for tile in tiles]
    firsts = np.cumsum([0, *(len(part.areas) for part in parts)])
    numbers = np.arange(len(tiles)).reshape(counts)
    pairs = [np.empty((2, 0), np.int64)]
    for lines, sides in ((numbers, (1, 0)), (numbers.T, (3, 2))):
        for both in pairwise(lines):
            # Hole numbers in the whole map on both sides of the border between two lines of tiles.
            last, first = (
                np.concatenate([tiles[n].edges[side].shifted(firsts[n]) for n in line])
                for line, side in zip(both, sides, strict=True)
            )
            # A hole may continue straight or diagonally across the border.
            for one, other in ((last, first), (last[1:], first[:-1]), (last[:-1], first[1:])):
                touch = (one > 0) & (other > 0)
                pairs.append(np.stack([one[touch], other[touch]]))
    touching = np.concatenate(pairs, axis=1)
    roots = _roots(firsts[-1] + 1, *touching)[1:]
    which, of_part = np.unique(roots, return_inverse=True)
    starts = np.full((len(which), 2), np.iinfo(np.int64).max)
    ends, areas = np.zeros((len(which), 2), np.int64), np.zeros(len(which), np.int64)
    np.minimum.at(starts, of_part, np.concatenate([part.starts for part in parts]))
    np.maximum.at(ends, of_part, np.concatenate([part.ends for part in parts]))
    np.add.at(areas, of_part, np.concatenate([part.areas for part in parts]))
    return Holes(starts, ends, areas)


def _roots(count: int, ones: Integers, others: Integers) -> Integers:
    """Return the smallest number in the group of each number below `count`.

    `ones[i]` and `others[i]` are in the same group.
    """
    roots = np.arange(count)
    while True:
        lowest = np.minimum(roots[ones], roots[others])
        lower = roots.copy()
        for numbers in (ones, others):
            np.minimum.at(lower, roots[numbers], lowest)
        lower = lower[lower]
        if np.array_equal(lower, roots):
            return roots
        roots = lower
