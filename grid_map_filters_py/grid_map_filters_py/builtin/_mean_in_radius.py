# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MeanInRadiusFilter`"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from grid_map_core_py._arrays import Layer

from .._shared.layer_filter import AroundTypicalValue, DiscFilter
from ..parts._disc import Disc, Tile, tiles

_FEW = 4
"""Largest reach of a small disc, in cells."""


@dataclass(frozen=True, kw_only=True)
class MeanInRadius(AroundTypicalValue, DiscFilter):
    """Give every cell the mean of the finite values in the disc of `radius` [m] around it.

    Cells without a finite value in their disc become NaN.
    """

    def _filter_around(self, offset: float, layer: Layer, resolution: float) -> Layer:
        disc = Disc(self.radius, resolution, layer.shape)
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
        too_large = ~np.isfinite(total)
        total /= tile.counts(known).astype(dtype)
    total += offset
    mean = tile.cells(total)
    # Only these cells, so that the others are the same in any tile.
    if dtype == np.float32 and too_large.any():
        exact = _mean(layer, tile, offset, np.float64).astype(np.float32)
        np.copyto(mean, exact, where=tile.cells(too_large))
    return mean
