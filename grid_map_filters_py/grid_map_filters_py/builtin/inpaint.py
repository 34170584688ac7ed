# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapCv/InpaintFilter`"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Layer, Mask

from ..filter import check_radius, warn


@dataclass(frozen=True, kw_only=True)
class Inpaint:
    """Fill the cells of a layer that are not finite from their surroundings.

    Uses the Navier-Stokes based method of Bertalmio, Bertozzi and Sapiro (2001) in OpenCV, on
    floats: finite cells keep their value to the bit. A layer without a finite cell stays as it is.

    Attributes:
        radius: of the neighbourhood that a filled cell is computed from [m], at least one cell.
    """

    input_layer: str
    output_layer: str
    radius: float

    def __post_init__(self) -> None:
        check_radius(self.radius)

    def __call__(self, grid_map: GridMap) -> GridMap:
        layer = grid_map[self.input_layer]
        holes = ~np.isfinite(layer)
        if holes.all():
            warn(f"layer {self.input_layer!r} has no finite cell to fill its holes from")
            return grid_map.with_layers({self.output_layer: layer.copy("F")})
        filled = layer.copy("F")
        if holes.any():
            with np.errstate(invalid="ignore"):
                filled[holes] = _fill(layer, holes, self.radius / grid_map.resolution)[holes]
        return grid_map.with_layers({self.output_layer: filled})


def _fill(layer: Layer, holes: Mask, radius: float) -> npt.NDArray[np.float64]:
    """Return the inpainted layer; `radius` in cells."""
    lowest, highest = (float(bound) for bound in (layer[~holes].min(), layer[~holes].max()))
    if lowest == highest:
        return np.full(layer.shape, lowest)
    # OpenCV weighs by gradients with thresholds that are made for grey values.
    scale = 255.0 / (highest - lowest)
    grey = np.where(holes, 0.0, (layer.astype(np.float64) - lowest) * scale)
    filled = _inpaint(grey.astype(np.float32), holes.astype(np.uint8), radius)
    return np.clip(filled, 0.0, 255.0) / scale + lowest


def _inpaint(image: Layer, mask: npt.NDArray[np.uint8], radius: float) -> npt.NDArray[np.float64]:
    # On images with sides of one or two pixels OpenCV reads beyond the border.
    margins = [(1, 1) if side < 3 else (0, 0) for side in image.shape]
    image, mask = np.pad(image, margins, mode="edge"), np.pad(mask, margins, mode="edge")
    filled = cv2.inpaint(
        np.ascontiguousarray(image), np.ascontiguousarray(mask), radius, cv2.INPAINT_NS
    )
    inner = tuple(slice(before, -after or None) for before, after in margins)
    return np.asarray(filled[inner], dtype=np.float64)
