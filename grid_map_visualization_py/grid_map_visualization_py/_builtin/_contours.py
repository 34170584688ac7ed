# SPDX-License-Identifier: BSD-3-Clause
"""Contour lines."""

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import max_of_finites, min_of_finites
from grid_map_core_py.errors import GridMapError, required
from grid_map_core_py.plugins import check

from .._markers import LineMarker

MOST_LEVELS = 10_000

_contourpy = partial(
    required, "contourpy", "contours", "install python3-matplotlib (apt) or contourpy (pip)"
)


@dataclass(frozen=True, kw_only=True)
class ContoursVisualization(LineMarker):
    """Draw contour lines of a layer, interpolated between cell centers.

    A square of four neighboring cells contains lines only if at least three values are finite.

    Attributes:
        layer: layer to draw, usually heights [m].
        interval: spacing of the contour values, which are multiples of `interval`.
        levels: contour values in any order; if set, `interval` is ignored.
        flat: draw all lines at height zero; useful for layers without heights.
    """

    layer: str
    interval: float = 0.1
    levels: tuple[float, ...] = ()
    flat: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        positive = math.isfinite(self.interval) and self.interval > 0
        check(positive, "interval", "a positive number", self.interval)
        finite = all(map(math.isfinite, self.levels))
        check(finite, "levels", "finite numbers", self.levels)
        _contourpy()

    def __call__(self, grid_map: GridMap) -> bytes:
        values = grid_map.unwrapped(self.layer).T
        low, high = min_of_finites(values), max_of_finites(values)
        lines = [np.empty((0, 3))]
        if min(values.shape) < 2 or math.isnan(low):
            return self.marker(grid_map, lines[0], Marker.LINE_LIST, "contours")
        levels = np.unique(self.levels)
        if not self.levels:
            first, last = np.ceil(low / self.interval), np.floor(high / self.interval)
            if last - first >= MOST_LEVELS:
                raise GridMapError(
                    f"parameter 'interval': {self.interval} gives more than {MOST_LEVELS} lines "
                    f"between {low} and {high}"
                )
            levels = np.arange(first, last + 1) * self.interval
        generator = _contourpy().contour_generator(
            *grid_map.geometry.axes_in_map_order(),
            np.ma.masked_invalid(values.astype(np.float64)),
            corner_mask=True,
            line_type="ChunkCombinedOffset",
        )
        for level in levels:
            (points,), (offsets,) = generator.lines(level)
            if points is not None:
                height = 0.0 if self.flat else level
                # Line k starts at point `offsets[k]`. Segments must not connect two lines.
                begins = np.delete(np.arange(len(points)), offsets[1:] - np.uint32(1))
                ends = points[np.stack([begins, begins + 1], axis=-1).ravel()]
                lines.append(np.insert(ends, 2, height, axis=1))
        return self.marker(grid_map, np.concatenate(lines), Marker.LINE_LIST, "contours")
