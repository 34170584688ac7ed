# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapCv/InpaintFilter`"""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from grid_map_core_py.arrays import Layer, Mask, elementwise, max_of_finites, min_of_finites
from grid_map_core_py.plugins import check

from .._filter import warn
from .._shared.layer_filter import LayerFilter, check_radius


@dataclass(frozen=True, kw_only=True)
class Inpaint(LayerFilter):
    """Fill the cells of a layer that are not finite from their surroundings.

    This is the Navier-Stokes method of Bertalmio, Bertozzi and Sapiro (2001) in OpenCV. Finite
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

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        filled, holes = layer.copy("F"), ~np.isfinite(layer)
        if holes.all():
            warn(f"layer {self.input_layer!r} has no finite cell to fill its holes from")
            return filled
        chosen = self._choose(holes, resolution)
        if chosen.any():
            with np.errstate(invalid="ignore"):
                filled[chosen] = _fill(layer, holes, self.radius / resolution)[chosen]
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


def _fill(layer: Layer, holes: Mask, radius: float) -> Layer:
    """Return the inpainted layer; `radius` in cells."""
    lowest, highest = min_of_finites(layer), max_of_finites(layer)
    if lowest == highest:
        return np.full_like(layer, lowest)
    # OpenCV weights by gradients, with thresholds for 8-bit gray values.
    scale = 255.0 / (highest - lowest)
    gray = elementwise(
        lambda heights: np.subtract(heights, lowest, dtype=np.float64) * scale, np.float32, layer
    )
    gray[holes] = 0.0
    # OpenCV reads beyond the border of images with sides of one or two pixels.
    margins = [(1, 1) if side < 3 else (0, 0) for side in layer.shape]
    image, mask = (
        np.ascontiguousarray(np.pad(values, margins, mode="edge"))
        for values in (gray, holes.astype(np.uint8))
    )
    filled = cv2.inpaint(image, mask, radius, cv2.INPAINT_NS)
    inner = tuple(slice(before, -after or None) for before, after in margins)
    return elementwise(
        lambda grays: np.clip(grays, 0.0, 255.0, dtype=np.float64) / scale + lowest,
        np.float32,
        np.asarray(filled[inner], dtype=np.float32),
    )
