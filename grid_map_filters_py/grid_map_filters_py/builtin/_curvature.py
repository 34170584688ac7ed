# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/CurvatureFilter`"""

from dataclasses import dataclass

import cv2
import numpy as np

from grid_map_core_py.arrays import Layer, slices

from .._shared.layer_filter import LayerFilter
from ..parts._cell_function import Value, cell_function, choose, helper, is_finite

_TWO, _ZERO, _NAN = np.float32(2), np.float32(0), np.float32(np.nan)

_PIECE = 2**15
"""Cells that are computed together, so that their temporaries stay in the cache."""


@dataclass(frozen=True, kw_only=True)
class Curvature(LayerFilter):
    """Compute the curvature of a layer, positive on hilltops: minus its second differences.

    At the border of the map, the cell itself replaces the missing neighbor. A second difference
    with a cell that is not finite counts as 0. Cells that are not finite become NaN.

    Attributes:
        input_layer: heights [m].
    """

    def __post_init__(self) -> None:
        _curvature.prepare()

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        curvature = np.empty_like(layer.T)
        for lines in slices(len(curvature), _PIECE // len(layer)):
            curvature[lines] = _of_lines(layer.T, lines, resolution)
        return curvature.T


def _of_lines(layer: Layer, lines: slice, resolution: float) -> Layer:
    """Return the curvature in some lines of a C-contiguous layer."""
    # Rows with a margin of one cell that repeats the map's border.
    first, last = max(lines.start - 1, 0), min(lines.stop + 1, len(layer))
    above, below = first - lines.start + 1, lines.stop + 1 - last
    border = above, below, 1, 1
    heights = cv2.copyMakeBorder(layer[first:last], *border, cv2.BORDER_REPLICATE)
    width, flat = heights.shape[1], heights.ravel()
    # Every cell, margin included, and its four neighbors.
    shifts = 0, -width, width, -1, 1
    neighbors = [flat[width + shift : flat.size - width + shift] for shift in shifts]
    return _curvature(neighbors, (-1 / resolution**2,)).reshape(-1, width)[:, 1:-1]


@cell_function(takes=np.float32, gives=np.float32, numbers=1)
def _curvature(
    height: Value, up: Value, down: Value, left: Value, right: Value, scale: tuple[Value, ...]
) -> Value:
    along = up - _TWO * height + down
    across = left - _TWO * height + right
    curvature = scale[0] * (_finite_or_zero(along) + _finite_or_zero(across))
    return choose(is_finite(height), curvature, _NAN)


@helper
def _finite_or_zero(value: Value) -> Value:
    return choose(is_finite(value), value, _ZERO)
