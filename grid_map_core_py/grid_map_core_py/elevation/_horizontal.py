# SPDX-License-Identifier: BSD-3-Clause
"""Heights and bounds that account for the horizontal uncertainty of cells.

The position error of a cell is normally distributed. Its variance along x and along y is the cell's
`horizontal_variance`. Each neighbor is weighted with the probability that the true position of the
cell lies in that neighbor.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from .._arrays._checks import Layer
from ..limits import check_cells

_REACH = 3.0  # largest distance to a neighbor [standard deviations]
_FARTHEST = 4  # largest distance to a neighbor [cells]
_TAIL = 0.01  # probability beyond a bound

Cells = NDArray[np.float64]
"""(rows, cols) in map order."""


def fused(heights: Cells, variances: Cells, horizontal: Cells, resolution: float) -> list[Layer]:
    """Return the layers of `ElevationMapper.fused_map`: height, variance, upper and lower bound."""
    known = ~np.isnan(heights)
    deviations = np.sqrt(np.where(known, horizontal, 0.0)) / resolution
    reach = min(int(np.ceil(_REACH * deviations.max(initial=0.0))), _FARTHEST)
    check_cells("horizontal uncertainty", heights.shape, 8 * (2 * reach + 1) ** 2)
    parts = [*_neighbors(heights, variances, deviations[known], known, reach)]
    weights, means, spreads = map(np.array, zip(*parts, strict=True))
    weights /= weights.sum(axis=0)
    mean = (weights * means).sum(axis=0)
    variance = (weights * (spreads + (means - mean) ** 2)).sum(axis=0)
    reaches = 2.486 * np.sqrt(spreads)
    upper = _quantile(means + reaches, weights)
    lower = -_quantile(reaches - means, weights)
    layers = []
    for values in (mean, variance, upper, lower):
        layer: Layer = np.full(heights.shape, np.nan, np.float32, order="F")
        layer[known] = values
        layers.append(layer)
    return layers


def _neighbors(
    heights: Cells, variances: Cells, deviations: Cells, known: NDArray[np.bool_], reach: int
) -> Iterator[tuple[Cells, Cells, Cells]]:
    """Yield weights (0 if unknown), heights and variances (k,), for one neighbor of all k cells."""
    padded = np.pad(heights, reach, constant_values=np.nan)
    spread = np.pad(variances, reach, constant_values=np.nan)
    # Probability that the position error along an axis rounds to each number of cells.
    with np.errstate(divide="ignore"):
        borders = np.arange(-reach, reach + 2)[:, None] - 0.5
        shares = np.diff(ndtr(borders / deviations), axis=0)
    rows, columns = heights.shape
    for i, along in enumerate(shares):
        for j, across in enumerate(shares):
            here = padded[i : i + rows, j : j + columns][known]
            there = ~np.isnan(here)
            variance = spread[i : i + rows, j : j + columns][known]
            yield (
                np.where(there, along * across, 0.0),
                np.where(there, here, 0.0),
                np.where(there, variance, 0.0),
            )


def _quantile(values: Cells, weights: Cells) -> Cells:
    """Return the weighted quantile `1 - _TAIL` (k,) of each column."""
    order = np.argsort(-values, axis=0)
    above = np.cumsum(np.take_along_axis(weights, order, axis=0), axis=0)
    place = np.take_along_axis(order, np.argmax(above > _TAIL, axis=0)[None], axis=0)
    return np.asarray(np.take_along_axis(values, place, axis=0)[0])
