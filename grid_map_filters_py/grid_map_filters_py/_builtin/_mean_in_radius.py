# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MeanInRadiusFilter`"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, Mask

from ..parts._disc import Disc
from ..parts._layer_filter import AroundTypicalValue, DiscFilter

_FEW = 4
"""Largest disc radius for which sums are computed in single precision [cells]."""


@dataclass(frozen=True, kw_only=True)
class MeanInRadius(AroundTypicalValue, DiscFilter):
    """Set every cell to the mean of the finite values within `radius` of it.

    A cell becomes NaN if there is no finite value within the radius.
    """

    def _filter_around(self, offset: float, layer: Layer, resolution: float) -> Layer:
        disc = Disc(self.radius, resolution, layer.shape)
        # Single precision is sufficient for sums of few values.
        dtype = np.float32 if max(disc.reach) <= _FEW else np.float64
        mean, too_large = _mean(disc, layer, offset, dtype)
        # If all cells were replaced, the results would depend on the division into blocks.
        if dtype == np.float32 and too_large.any():
            exact, _ = _mean(disc, layer, offset, np.float64)
            mean[too_large] = exact[too_large]
        return mean


def _mean(
    disc: Disc, layer: Layer, offset: float, dtype: type[np.floating[Any]]
) -> tuple[npt.NDArray[Any], Mask]:
    """Return the means over the discs, and a mask of the cells whose sums overflow."""
    with np.errstate(invalid="ignore", over="ignore"):
        known, values = disc.padded(layer, offset, dtype)
        total = disc.sums(values)
        too_large = ~np.isfinite(total)
        total /= disc.counts(known).astype(dtype)
    total += offset
    return total, too_large
