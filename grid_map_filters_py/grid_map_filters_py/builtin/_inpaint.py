# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapCv/InpaintFilter`"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py.arrays import Layer, Mask, elementwise, max_of_finites, min_of_finites
from grid_map_core_py.loops import Compiled
from grid_map_core_py.plugins import check

from .._filter import WHOLE_MAP, warn
from .._shared.inpaint_loop import inpaint
from .._shared.layer_filter import LayerFilter, check_radius
from ..parts._side_by_side import side_by_side, thread_count

Block = tuple[slice, ...]
Own = Callable[[], Mask]
Integers = npt.NDArray[np.integer[Any]]

_SIDE = 500
"""Usual side of a block of cells that is inpainted at once, so that images fit the cache."""

_LARGEST_RADIUS = 100.0
"""OpenCV's limit [cells]."""


@dataclass(frozen=True, kw_only=True)
class Inpaint(LayerFilter):
    """Fill the cells of a layer that are not finite from their surroundings.

    This is the Navier-Stokes method of Bertalmio, Bertozzi and Sapiro (2001), as in OpenCV. Finite
    cells keep their bits. A layer without finite cells stays unchanged. Missing cells that touch,
    also at a corner, belong to one hole.

    Attributes:
        radius: radius of the neighborhood from which a cell is filled [m], at least one cell.
        enclosed_holes_only: do not fill holes that reach the border of the map.
        max_hole_area: area of the largest hole to fill [m^2]; no limit by default.
    """

    radius: float
    enclosed_holes_only: bool = False
    max_hole_area: float | None = None

    def __post_init__(self) -> None:
        check_radius(self.radius)
        area = self.max_hole_area or 0.0
        check(math.isfinite(area) and area >= 0, "max_hole_area", "an area >= 0 [m^2]", area)
        inpaint.compiled()

    def reach(self, _resolution: float) -> float:
        # A hole may be as large as the map, and gray values depend on all heights.
        return WHOLE_MAP

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        filled, holes = layer.copy("F"), ~np.isfinite(layer)
        if holes.all():
            warn(f"layer {self.input_layer!r} has no finite cell to fill its holes from")
            return filled
        chosen = self._choose(holes, resolution)
        if chosen.any():
            _fill(filled, holes, chosen, self.radius / resolution)
        return filled

    def _choose(self, holes: Mask, resolution: float) -> Mask:
        """Return the mask of the holes to fill."""
        if not self.enclosed_holes_only and self.max_hole_area is None:
            return holes
        _, labels, sizes, _ = cv2.connectedComponentsWithStats(holes.T.astype(np.uint8))
        area = sizes[:, cv2.CC_STAT_AREA] * resolution**2
        limit = math.inf if self.max_hole_area is None else self.max_hole_area
        wanted = area <= limit * (1 + 1e-9)
        if self.enclosed_holes_only:
            for side in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
                wanted[side] = False
        # Label 0 marks all cells outside of holes.
        wanted[0] = False
        return np.asarray(wanted[labels].T)


def _fill(layer: Layer, holes: Mask, chosen: Mask, radius: float) -> None:
    """Inpaint a layer in place; `radius` in cells.

    Args:
        layer: heights, not finite in holes.
        holes: mask of all holes.
        chosen: mask of the holes to fill.
    """
    lowest, highest = min_of_finites(layer), max_of_finites(layer)
    if lowest == highest:
        layer[chosen] = lowest
        return
    if min(layer.shape) < 3:
        # OpenCV reads beyond the border of images with sides of one or two pixels.
        margins = [(1, 1) if side < 3 else (0, 0) for side in layer.shape]
        inner = tuple(slice(before, -after or None) for before, after in margins)
        whole = np.asfortranarray(np.pad(layer, margins, "edge"))
        wanted = np.asfortranarray(np.pad(chosen, margins, "edge"))
        _fill(whole, ~np.isfinite(whole), wanted, radius)
        layer[chosen] = whole[inner][chosen]
        return
    # The method weights by gradients, with thresholds for 8-bit gray values.
    scale = 255.0 / (highest - lowest)
    run = inpaint.compiled()
    if run is not None and thread_count() <= 2:
        # To find the blocks, and to copy them, takes as long as a second thread saves.
        _fill_compiled(run, layer, holes, chosen, radius, lowest, scale)
        return

    def fill(part: tuple[Block, Own]) -> None:
        block, own = part
        cells = own()
        if run is None:
            # Column after column, as the layers are stored.
            columns, rows = np.nonzero(cells.T)
            grays = _inpainted(layer[block], holes[block], radius, lowest, scale)[rows, columns]
            heights = np.clip(grays, 0.0, 255.0, dtype=np.float64) / scale + lowest
            layer[block][rows, columns] = heights
            return
        # Other threads fill holes of this block meanwhile.
        heights = np.where(holes[block], np.float32(np.nan), layer[block])
        _fill_compiled(run, heights, holes[block], cells, radius, lowest, scale)
        np.copyto(layer[block], heights, where=cells)

    side_by_side(fill, _parts(holes, chosen, radius))


def _fill_compiled(
    run: Compiled,
    layer: Layer,
    holes: Mask,
    chosen: Mask,
    radius: float,
    lowest: float,
    scale: float,
) -> None:
    rows, columns = layer.shape
    # OpenCV's limits. Further cells are outside of the layer.
    reach = round(min(max(radius, 1.0), _LARGEST_RADIUS, rows + columns))
    # As one block, which the C library keeps for the next map.
    images = np.empty((4, rows + 2 * reach, columns + 2 * reach), np.float32)
    images[0] = 0.0
    images[0, reach:-reach, reach:-reach] = layer
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    inside = x**2 + y**2 <= reach**2
    offsets = (y * images.shape[2] + x)[inside]
    x, y = (values[inside].astype(np.float32) for values in (x, y))
    squares = x * x + y * y
    disc = x, y, squares, 1 / (squares * squares + 1)
    run(
        tuple(images),
        (rows, columns, reach),
        (lowest, scale),
        (*disc, np.empty_like(x)),
        offsets,
        offsets.size,
        tuple(np.empty((2, np.count_nonzero(holes)), np.int64)),
        np.asfortranarray(chosen).view(np.uint8),
        layer,
    )


def _parts(holes: Mask, chosen: Mask, radius: float) -> Iterator[tuple[Block, Own]]:
    """Yield blocks of cells that are inpainted at once, and functions that return their own cells.

    OpenCV fills a cell from cells within `radius` and their neighbors. Holes that are further apart
    know nothing of each other, so that a block with all cells of a group of holes, and the cells
    around them, gives the bits of the whole layer.
    """
    if holes.size < 2 * _SIDE**2:
        yield (slice(None), slice(None)), lambda: chosen
        return
    near = math.ceil(min(max(radius, 1.0), _LARGEST_RADIUS)) + 1
    # Two cells in reach of each other touch when each becomes a block of this side.
    grown = cv2.dilate(holes.T.view(np.uint8), np.ones((near, near), np.uint8))
    # Rows of the map are along x of the image. The label 0 marks all cells outside of holes.
    count, labels = cv2.connectedComponents(grown, connectivity=8)
    # OpenCV's boxes would take twice as long as its labels.
    cells = np.flatnonzero(holes.T)
    places = np.divmod(cells, len(holes))[::-1]
    (rows, columns), ends = _boxes(places, labels.ravel()[cells], count)
    heights, widths = ends[0] - rows, ends[1] - columns
    tiles = 1 + rows // _SIDE + math.ceil(holes.shape[0] / _SIDE) * (columns // _SIDE)
    # Large groups share a block, which may be the whole layer.
    tiles[np.maximum(heights, widths) > _SIDE] = 0
    tiles[0] = -1
    for tile in np.unique(tiles[1:]):
        group = tiles == tile
        block = tuple(
            slice(max(first[group].min() - near - 1, 0), end[group].max() + near + 1)
            for first, end in zip((rows, columns), ends, strict=True)
        )
        yield block, partial(_own_cells, chosen[block], labels.T[block], group)


def _boxes(
    places: Sequence[Integers], groups: npt.NDArray[Any], count: int
) -> tuple[list[Integers], list[Integers]]:
    """Return the first places of groups along each axis, and the ends behind the last ones."""
    firsts, ends = [], []
    for along in places:
        first, last = np.full(count, along.max()), np.zeros(count, along.dtype)
        np.minimum.at(first, groups, along)
        np.maximum.at(last, groups, along)
        firsts.append(first)
        ends.append(last + 1)
    return firsts, ends


def _own_cells(chosen: Mask, labels: npt.NDArray[Any], group: Mask) -> Mask:
    own: Mask = group[labels]
    return own & chosen


def _inpainted(
    heights: Layer, holes: Mask, radius: float, lowest: float, scale: float
) -> npt.NDArray[np.float32]:
    """Return gray values, inpainted where there are holes."""
    gray = elementwise(
        lambda known: np.subtract(known, lowest, dtype=np.float64) * scale,
        np.float32,
        np.ascontiguousarray(heights),
    )
    gray[holes] = 0.0
    image, mask = np.ascontiguousarray(gray), np.ascontiguousarray(holes, dtype=np.uint8)
    return np.asarray(cv2.inpaint(image, mask, radius, cv2.INPAINT_NS), dtype=np.float32)
