# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MeanInRadiusFilter`"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from grid_map_core_py.arrays import Layer

from .._shared.layer_filter import DiscFilter
from ..parts._disc import Disc, Tile, tiles, typical_value

_FEW = 4
"""Largest reach of a small disc, in cells."""


@dataclass(frozen=True, kw_only=True)
class MeanInRadius(DiscFilter):
    """Give every cell the mean of the finite values in the disc of `radius` [m] around it.

    Cells without a finite value in their disc become NaN.
    """

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        offset, disc = typical_value(layer), Disc(self.radius, resolution, layer.shape)
        # For a few values, sums in single precision are as exact as the layer.
        dtype = np.float32 if max(disc.reach) <= _FEW else np.float64
        mean = np.empty_like(layer, order="F")
        for tile in tiles(disc):
            mean[tile.rows, tile.columns] = _mean(layer, tile, offset, dtype)
        return mean


def _mean(layer: Layer, tile: Tile, offset: float, dtype: type[np.floating[Any]]) -> Layer:
    """Return the means of the cells of a tile, from differences to `offset`."""
    with np.errstate(invalid="ignore", over="ignore"):
        known, values = tile.finite(layer, offset, dtype)
        total = tile.sums(values)
        if not np.isfinite(total).all():
            return _mean(layer, tile, offset, np.float64)
        total /= tile.counts(known).astype(dtype)
    total += offset
    return tile.cells(total)
