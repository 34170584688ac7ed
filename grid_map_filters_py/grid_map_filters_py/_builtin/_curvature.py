# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/CurvatureFilter`"""

from dataclasses import dataclass

import cv2
import numpy as np

from grid_map_core_py._arrays import Layer

from ..parts._cell_function import Value, cell_function, choose, is_finite
from ..parts._layer_filter import LayerFilter

_TWO, _ZERO, _NAN = np.float32(2), np.float32(0), np.float32(np.nan)


@dataclass(frozen=True, kw_only=True)
class Curvature(LayerFilter):
    """Compute the curvature of a layer: the negative Laplacian of the heights [1/m].

    The Laplacian is the sum of the second differences along x and y, divided by the square of the
    cell size. The curvature is positive on hilltops. At the border of the map, the cell itself
    replaces the missing neighbor. A second difference that includes a non-finite cell counts as 0.
    Non-finite cells become NaN.

    Attributes:
        input_layer: heights [m].
    """

    def __post_init__(self) -> None:
        _curvature.prepare()

    def reach(self, _resolution: float) -> float:
        return 1

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        heights = cv2.copyMakeBorder(layer.T, 1, 1, 1, 1, cv2.BORDER_REPLICATE)
        width, flat = heights.shape[1], np.asarray(heights).ravel()
        # Slices of the flattened image with its left and right margins: cells and their neighbors.
        shifts = 0, -width, width, -1, 1
        neighbors = [flat[width + shift : flat.size - width + shift] for shift in shifts]
        curvature = _curvature(neighbors, (-1 / resolution**2,))
        return curvature.reshape(-1, width)[:, 1:-1].T


@cell_function(takes=np.float32, gives=np.float32, numbers=1)
def _curvature(
    height: Value, up: Value, down: Value, left: Value, right: Value, scale: tuple[Value, ...]
) -> Value:
    along = up - _TWO * height + down
    across = left - _TWO * height + right
    curvature = scale[0] * (_finite_or_zero(along) + _finite_or_zero(across))
    return choose(is_finite(height), curvature, _NAN)


def _finite_or_zero(value: Value) -> Value:
    return choose(is_finite(value), value, _ZERO)
