# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Extremes over the disc around every cell at once."""

import cv2
import numpy as np

from grid_map_core_py.arrays import Layer

from ..parts._disc import Disc


def highest_in_disc(layer: Layer, disc: Disc, *, fill: bool = True) -> Layer:
    """Return for every cell the largest finite value in the disc around it, NaN where none is.

    It is the grey-scale dilation of the layer by the disc, blind to cells that are not finite and
    to what lies beyond the border of the map.

    Args:
        layer: (rows, cols).
        disc: has the size of the layer.
        fill: whether cells that are not finite in the layer get a value too.

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
    """Return for every cell the smallest finite value in the disc; see `highest_in_disc`."""
    return -highest_in_disc(-layer, disc, fill=fill)
