# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MedianFillFilter`"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check

from .._filter import in_map_order
from ..parts._blocks import blockwise
from ..parts._disc import disc_reach
from ..parts._layer_filter import check_radius
from ..parts._medians import put_window_medians

_BLOCK = np.ones((3, 3), np.uint8)
_TOLERANCE = 1e-9
"""Number added to radii [cells] before rounding down, to allow for rounding errors."""


@dataclass(frozen=True, kw_only=True)
class MedianFill:
    """Fill holes with the median of the finite values in the square around each cell.

    If the number of values is even, the median is the larger of the two middle values. The result
    has no basic layers. If you need basic layers, set them after this filter.

    Attributes:
        input_layer: layer to filter.
        output_layer: layer for the result.
        fill_hole_radius: half the width of the square [m], rounded down to whole cells.
        filter_existing_values: if true, the filter also smooths finite cells where the mask is not
            0.
        existing_value_radius: half the width of the square for finite cells [m]; required with
            `filter_existing_values`.
        fill_mask_layer: mask layer; cells where it is 0 do not change. If the map lacks this layer,
            the filter computes it.
        num_erode_dilation_iterations: number of one-cell dilations that close gaps in the computed
            mask. The same number of erosions follows.
        debug: if true, the result also contains the computed mask before its gaps are closed.
        debug_infill_mask_layer: layer for the mask of `debug`; required with `debug`.
    """

    input_layer: str
    output_layer: str
    fill_hole_radius: float
    filter_existing_values: bool = False
    existing_value_radius: float | None = None
    fill_mask_layer: str
    num_erode_dilation_iterations: int = 4
    debug: bool = False
    debug_infill_mask_layer: str | None = None

    def __post_init__(self) -> None:
        check_radius(self.fill_hole_radius, "fill_hole_radius")
        if self.existing_value_radius is not None:
            check_radius(self.existing_value_radius, "existing_value_radius")
        elif self.filter_existing_values:
            raise ConfigError("'filter_existing_values' needs an 'existing_value_radius'")
        if self.debug and not self.debug_infill_mask_layer:
            raise ConfigError("'debug' needs a 'debug_infill_mask_layer'")
        debug_layer = self.debug_infill_mask_layer if self.debug else None
        names = [self.output_layer, self.fill_mask_layer, debug_layer]
        if len(set(names)) < len(names):
            raise ConfigError(
                "expected different 'output_layer', 'fill_mask_layer' and "
                f"'debug_infill_mask_layer', got {', '.join(map(repr, names))}"
            )
        iterations = self.num_erode_dilation_iterations
        check(iterations >= 0, "num_erode_dilation_iterations", "an integer >= 0", iterations)

    def reach(self, resolution: float) -> float:
        radii = [self.fill_hole_radius, self._existing_value_radius or 0.0]
        # The opening reaches two cells; each iteration of the closing dilates and erodes.
        of_mask = 2 + 2 * self.num_erode_dilation_iterations
        return max(of_mask, *(disc_reach(radius, resolution) for radius in radii))

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        layer, masks = grid_map[self.input_layer], dict[str, Layer]()
        if self.fill_mask_layer not in grid_map:
            if self.debug and self.debug_infill_mask_layer:
                masks[self.debug_infill_mask_layer] = _mask(layer, 0)
            masks[self.fill_mask_layer] = _mask(layer, self.num_erode_dilation_iterations)
        holes, existing = (
            -1 if radius is None else math.floor(radius / grid_map.resolution + _TOLERANCE)
            for radius in (self.fill_hole_radius, self._existing_value_radius)
        )

        def fill(values: Layer, mask: Layer) -> Layer:
            known, chosen, output = np.isfinite(values), mask != 0, values.copy("F")
            for cells, half_width in ((~known & chosen, holes), (known & chosen, existing)):
                if half_width >= 0 and cells.any():
                    put_window_medians(output, values, cells, half_width)
            return output

        chosen = grid_map.with_layers(masks)[self.fill_mask_layer]
        output = blockwise(fill, layer, chosen, reach=max(holes, existing))
        result = grid_map.with_layers({self.output_layer: output, **masks})
        result.basic_layers = ()
        return result

    @property
    def _existing_value_radius(self) -> float | None:
        return self.existing_value_radius if self.filter_existing_values else None


def _mask(layer: Layer, iterations: int) -> Layer:
    """Return a mask that is 1 in cells that may change, and 0 elsewhere.

    Opening the mask of finite cells removes narrow areas. Closing it then fills gaps.
    """
    # After max(rows, cols) steps the mask cannot grow further.
    iterations = min(iterations, max(layer.shape))

    def closed(values: Layer) -> Layer:
        known = np.isfinite(values).T.view(np.uint8)
        solid = cv2.morphologyEx(known, cv2.MORPH_OPEN, _BLOCK)
        grown = cv2.dilate(solid, _BLOCK, iterations=iterations)
        return cv2.erode(grown, _BLOCK, iterations=iterations).T.astype(np.float32)

    return blockwise(closed, layer, reach=2 + 2 * iterations)
