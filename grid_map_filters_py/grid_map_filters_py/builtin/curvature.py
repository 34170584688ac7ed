# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/CurvatureFilter`"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Layer
from grid_map_core_py.pieces import slices

Kernel = npt.NDArray[np.float64]

_PIECE = 2**15
"""Cells whose temporaries stay in the cache."""


@dataclass(frozen=True, kw_only=True)
class Curvature:
    """Compute the curvature of a layer, positive on hilltops: minus its second differences.

    At the border of the map the cell itself stands for the missing neighbour. A difference that
    meets a cell that is not finite counts as 0; cells that are not finite themselves become NaN.
    """

    input_layer: str
    output_layer: str

    def __call__(self, grid_map: GridMap) -> GridMap:
        layer = grid_map[self.input_layer].T
        curvature = np.empty_like(layer)
        for lines in slices(len(layer), _PIECE // layer.shape[1]):
            # One line more on either side, as far as there is one.
            first = max(lines.start - 1, 0)
            part = _curvature(layer[first : lines.stop + 1], grid_map.resolution)
            curvature[lines] = part[lines.start - first :][: lines.stop - lines.start]
        return grid_map.with_layers({self.output_layer: curvature.T})


def _curvature(heights: Layer, resolution: float) -> Layer:
    differences, none = np.array([1.0, -2.0, 1.0]) / -(resolution**2), np.ones(1)
    with np.errstate(invalid="ignore", over="ignore"):
        # NaN where not finite, else 0.
        missing = heights - heights
        heights = heights + missing
        curvature = _filter(heights, differences, none)
        curvature += _filter(heights, none, differences)
        curvature += missing
    return curvature


def _filter(heights: Layer, along: Kernel, across: Kernel) -> Layer:
    """Return the sum of the neighbours times a kernel, border cells repeated; 0 where NaN."""
    border = cv2.BORDER_REPLICATE
    result = cv2.sepFilter2D(heights, cv2.CV_32F, along, across, borderType=border)
    return np.asarray(cv2.patchNaNs(result, 0.0), dtype=np.float32)
