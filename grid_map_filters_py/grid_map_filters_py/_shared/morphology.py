# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Gray-scale dilation and erosion by a disc."""

import cv2
import numpy as np

from grid_map_core_py.arrays import Layer

from ..parts._disc import Disc


def highest_in_disc(layer: Layer, disc: Disc, *, fill: bool = True) -> Layer:
    """Return the largest finite value in the disc around every cell, NaN if there is none.

    This is the gray-scale dilation of the layer with the disc as structuring element. It ignores
    cells that are not finite.

    Args:
        layer: (rows, cols).
        disc: disc for the size of the layer.
        fill: True also gives values to cells that are not finite in the layer.

    Returns:
        (rows, cols) float32 in Fortran order.
    """
    finite = np.isfinite(layer)
    known = np.where(finite, layer, np.float32(-np.inf))
    element = np.ascontiguousarray(disc.kernel.T, dtype=np.uint8)
    highest = cv2.dilate(known.T, element, borderType=cv2.BORDER_CONSTANT, borderValue=-np.inf)
    highest[np.isneginf(highest) if fill else ~finite.T] = np.nan
    return np.asarray(highest.T, dtype=np.float32)


def lowest_in_disc(layer: Layer, disc: Disc, *, fill: bool = True) -> Layer:
    """Return the smallest finite value in the disc around every cell; see `highest_in_disc`."""
    return -highest_in_disc(-layer, disc, fill=fill)
