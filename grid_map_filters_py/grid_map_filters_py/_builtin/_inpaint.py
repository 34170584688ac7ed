# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapCv/InpaintFilter`"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py._arrays import Layer, Mask, Size, elementwise, max_of_finites, min_of_finites
from grid_map_core_py.plugins import check

from .._filter import WHOLE_MAP, Filter, TileOptions, warn
from ..errors import FilterError
from ..parts._holes import FindHoles, Holes, find_holes, merged, place_of
from ..parts._inpaint_loop import inpainted
from ..parts._layer_filter import LayerFilter, check_radius
from ..parts._side_by_side import side_by_side, thread_count

if TYPE_CHECKING:
    from grid_map_core_py.tiled import TiledMap
    from grid_map_core_py.tiled._source import Window

_LARGEST_RADIUS = 100.0
"""Maximum radius that OpenCV accepts [cells]."""

_MARGIN = 16
"""Margin around holes in a tile [cells], to which a few radii are added. Cells beyond the margin
change the result by less than 1e-6 of the value range, even if half of the cells are missing."""

_BEYOND = 32
"""Initial border around a tile [cells], wide enough for most holes that cross the tile edge."""


@dataclass(frozen=True, kw_only=True)
class Inpaint(LayerFilter):
    """Fill the non-finite cells of a layer from surrounding cells.

    The filter uses the Navier-Stokes method of Bertalmio, Bertozzi and Sapiro (2001), as in OpenCV.
    Finite cells keep their values. A layer without finite cells is copied, with a warning.
    Non-finite cells that touch, even if only at corners, form one hole.

    Attributes:
        radius: radius of the neighborhood used to fill a cell [m], clamped to 1 to 100 cells.
        enclosed_holes_only: if true, holes that reach the map border are not filled.
        max_hole_area: area of the largest hole to fill [m^2]; no limit by default.
    """

    radius: float
    enclosed_holes_only: bool = False
    max_hole_area: float | None = None

    def __post_init__(self) -> None:
        check_radius(self.radius)
        area = self.max_hole_area or 0.0
        check(math.isfinite(area) and area >= 0, "max_hole_area", "an area >= 0 [m^2]", area)

    def reach(self, _resolution: float) -> float:
        # A hole may be as large as the map, and the scale of the gray values depends on all
        # heights.
        return WHOLE_MAP

    def for_tiles_of(self, tiled_map: "TiledMap", options: TileOptions) -> Filter:
        find = FindHoles(self.input_layer, tiled_map.geometry, options.max_hole)
        tiles = tiled_map.over_tiles(find, [self.input_layer])
        rows, columns = tiled_map.tiles.counts
        holes = merged(tiles, (rows, columns))
        if options.large_holes == "refuse":
            self._refuse(holes, tiled_map.geometry, options.max_hole)
        lowest = min_of_finites([tile.lowest for tile in tiles])
        highest = max_of_finites([tile.highest for tile in tiles])
        if math.isnan(lowest):
            self._warn_of_no_cell()
        has_long = bool((holes.lengths > options.max_hole).any())
        fills_all = not (has_long or self._chooses)
        return _InpaintTiles(
            self, tiled_map.geometry, (lowest, highest), options.max_hole, fills_all
        )

    def _refuse(self, holes: Holes, geometry: GridGeometry, max_hole: int) -> None:
        """Raise a FilterError if a hole to fill is longer than `max_hole`."""
        lengths = holes.lengths * self.wanted(holes, geometry.size, geometry.resolution)
        if not (lengths > max_hole).any():
            return
        longest = int(lengths.argmax())
        (row, column), (end, behind) = holes.starts[longest], holes.ends[longest]
        x, y = geometry.cropped(slice(row, end), slice(column, behind)).position
        raise FilterError(
            f"max_hole: expected holes of at most {max_hole} cells, got one of {end - row} x "
            f"{behind - column} cells around ({x:g}, {y:g}). Give a larger 'max_hole', which takes "
            "memory, or large_holes='leave' to leave such holes as they are"
        )

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        filled, missing = layer.copy("F"), ~np.isfinite(layer)
        if missing.all():
            self._warn_of_no_cell()
            return filled
        chosen = missing
        if self._chooses:
            labels, holes = find_holes(missing)
            chosen = _mask(labels, self.wanted(holes, missing.shape, resolution))
        if chosen.any():
            extremes = min_of_finites(layer), max_of_finites(layer)
            _fill(filled, layer, missing, chosen, self.radius / resolution, extremes)
        return filled

    @property
    def _chooses(self) -> bool:
        """True if the parameters may leave some holes unfilled."""
        return self.enclosed_holes_only or self.max_hole_area is not None

    def wanted(self, holes: Holes, size: Size, resolution: float) -> Mask:
        """Return an (n,) mask that is True for the holes to fill."""
        limit = math.inf if self.max_hole_area is None else self.max_hole_area
        wanted: Mask = holes.areas * resolution**2 <= limit * (1 + 1e-9)
        return wanted & ~holes.touch_border(size) if self.enclosed_holes_only else wanted

    def _warn_of_no_cell(self) -> None:
        warn(f"layer {self.input_layer!r} has no finite cell to fill its holes from")


@dataclass(frozen=True)
class _InpaintTiles:
    """Version of the filter `whole` for the tiles of a large map.

    Args:
        geometry: geometry of the whole map.
        extremes: lowest and highest finite value of the whole layer; NaN if there are none.
        max_hole: length of the longest hole to fill [cells].
        fills_all: True if every hole of the map is filled.
    """

    whole: Inpaint
    geometry: GridGeometry
    extremes: tuple[float, float]
    max_hole: int
    fills_all: bool

    def reach(self, _resolution: float) -> float:
        return _BEYOND + self._margin

    def missing(self, tile: GridMap, window: "Window") -> int:
        """See `WideningFilter.missing`.

        A tile is large enough if it contains every hole that reaches into the window, with a margin
        around the hole. Holes longer than `max_hole` are ignored.
        """
        starts = [part.start for part in window]
        ends = [length - part.stop for length, part in zip(tile.size, window, strict=True)]
        border, widest = int(max(*starts, *ends)), self.max_hole + self._margin
        missing = ~np.isfinite(tile[self.whole.input_layer])
        if border >= widest or not missing[window].any():
            return 0
        labels, holes = find_holes(missing)
        reaching, leaving = np.zeros((2, len(holes.areas) + 1), np.bool_)
        reaching[labels[window]] = True
        # Mark holes in the margin of the tile, on sides where the map continues.
        for lines, first, whole in zip(
            (labels, labels.T), place_of(tile, self.geometry), self.geometry.size, strict=True
        ):
            if first > 0:
                leaving[lines[: self._margin]] = True
            if first + len(lines) < whole:
                leaving[lines[-self._margin :]] = True
        if not ((reaching & leaving)[1:] & (holes.lengths <= self.max_hole)).any():
            return 0
        return min(max(border - self._margin, 1), widest - border)

    def __call__(self, grid_map: GridMap) -> GridMap:
        layer = grid_map[self.whole.input_layer]
        filled, missing = layer.copy("F"), ~np.isfinite(layer)
        chosen = missing if self.fills_all else self._chosen(missing, grid_map)
        if chosen.any() and not math.isnan(self.extremes[0]):
            radius = self.whole.radius / self.geometry.resolution
            _fill(filled, layer, missing, chosen, radius, self.extremes)
        return grid_map.with_layers({self.whole.output_layer: filled})

    def _chosen(self, missing: Mask, tile: GridMap) -> Mask:
        """Return a mask of the cells to fill in a tile."""
        labels, holes = find_holes(missing)
        in_map = holes.moved(place_of(tile, self.geometry))
        wanted = self.whole.wanted(in_map, self.geometry.size, self.geometry.resolution)
        # Holes cut off by the tile edge do not matter: they are too long, or outside the window.
        return _mask(labels, wanted & (holes.lengths <= self.max_hole))

    @property
    def _margin(self) -> int:
        """Margin around holes [cells]."""
        return _MARGIN + 4 * _near(self.whole.radius / self.geometry.resolution)


def _mask(labels: npt.NDArray[Any], wanted: Mask) -> Mask:
    """Return a mask of the cells in wanted holes; the cells of hole i have the label i + 1."""
    return np.asarray(np.append(False, wanted)[labels])


def _near(radius: float) -> int:
    """Return the largest distance [cells] at which holes affect each other."""
    return math.ceil(min(max(radius, 1.0), _LARGEST_RADIUS)) + 1


def _fill(
    filled: Layer,
    layer: Layer,
    holes: Mask,
    chosen: Mask,
    radius: float,
    extremes: tuple[float, float],
) -> None:
    """Inpaint the chosen cells of `layer`, and write the results into its copy `filled`.

    `holes` is a mask of all holes, chosen or not. `radius` is in cells. `extremes` are the lowest
    and the highest value of the whole layer.
    """
    lowest, highest = extremes
    if lowest == highest:
        filled[chosen] = lowest
        return
    if min(layer.shape) < 3:
        # OpenCV reads out of bounds if a side of the image has only one or two pixels.
        margins = [(1, 1) if side < 3 else (0, 0) for side in layer.shape]
        inner = tuple(slice(before, -after or None) for before, after in margins)
        whole = np.asfortranarray(np.pad(layer, margins, "edge"))
        wanted = np.asfortranarray(np.pad(chosen, margins, "edge"))
        wide = whole.copy("F")
        _fill(wide, whole, ~np.isfinite(whole), wanted, radius, extremes)
        filled[chosen] = wide[inner][chosen]
        return
    # The weights depend on gradients, with thresholds for gray values from 0 to 255.
    scale = 255.0 / (highest - lowest)

    def fill(strip: tuple[slice, Mask]) -> None:
        columns, own = strip
        gray = elementwise(
            lambda known: np.subtract(known, lowest, dtype=np.float64) * scale,
            np.float32,
            np.ascontiguousarray(layer[:, columns]),
        )
        missing = ~np.isfinite(gray)
        gray[missing] = 0.0
        grays = inpainted(gray, missing, min(max(radius, 1.0), _LARGEST_RADIUS))
        if grays is None:
            image, mask = np.ascontiguousarray(gray), np.ascontiguousarray(missing, dtype=np.uint8)
            grays = np.asarray(cv2.inpaint(image, mask, radius, cv2.INPAINT_NS), dtype=np.float32)
        # Write column by column, in the memory order of the layers.
        places, rows = np.nonzero((own & chosen[:, columns]).T)
        heights = np.clip(grays[rows, places], 0.0, 255.0, dtype=np.float64) / scale + lowest
        filled[:, columns][rows, places] = heights

    side_by_side(fill, _strips(holes, _near(radius), thread_count()))


def _strips(holes: Mask, near: int, count: int) -> Iterator[tuple[slice, Mask]]:
    """Yield up to `count` strips of columns, each with a mask of the holes to fill together.

    The value of a filled cell depends only on the cells within the radius and on their neighbors.
    Groups of holes that are more than `near` cells apart are therefore independent. Filling only
    the columns around a group gives exactly the same values as filling the whole layer.
    """
    columns = holes.shape[1]
    if count == 1:
        yield slice(0, columns), holes
        return
    # Dilation with blocks of side `near` joins holes that affect each other.
    grown = cv2.dilate(holes.T.view(np.uint8), np.ones((near, near), np.uint8))
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(grown, connectivity=8)
    starts, lengths = boxes[:, cv2.CC_STAT_TOP], boxes[:, cv2.CC_STAT_HEIGHT]
    strips = starts * count // columns
    strips[0] = -1  # cells outside all groups
    for strip in range(count):
        if (own := strips == strip).any():
            begin, end = starts[own].min(), (starts + lengths)[own].max()
            around = slice(max(begin - near - 1, 0), min(end + near + 1, columns))
            yield around, own[labels[around]].T & holes[:, around]
