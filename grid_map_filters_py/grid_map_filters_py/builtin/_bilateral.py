# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/BilateralFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Layer, slices
from grid_map_core_py.plugins import check

from .._filter import in_map_order
from .._shared.disc_filter import check_radius
from ..parts._disc import Disc

# OpenCV has such a filter, but it spreads NaN, and its table of weights is as coarse as the layer's
# range is wide: one outlier, and the edges are lost.

_FAR = np.float32(12.0)
"""Standard deviations from which on a value has next to no weight, 5e-32, and counts as missing."""

_NOTHING = np.float32(1e-26)
"""Standard deviations that are no more than what the missing values have added up to."""

_PIECE = 2**15
"""Cells that are computed together, so that their temporaries stay in the cache."""


@dataclass(frozen=True, kw_only=True)
class Bilateral:
    """Smooth a layer, but not across its edges.

    Every finite cell becomes the mean of the finite values in the disc around it, each weighted by
    a Gaussian of its distance and one of its difference in value (C. Tomasi and R. Manduchi,
    "Bilateral filtering for gray and color images", ICCV 1998). Other cells are NaN.

    Attributes:
        input_layer: the layer to filter.
        output_layer: the result goes there.
        sigma_space: standard deviation of the Gaussian of distances [m].
        sigma_range: standard deviation of the Gaussian of differences, in the unit of the layer:
            steps much higher than this stay sharp.
        radius: of the disc [m]; without it 3 `sigma_space`.
    """

    input_layer: str
    output_layer: str
    sigma_space: float
    sigma_range: float
    radius: float | None = None

    def __post_init__(self) -> None:
        limits = np.finfo(np.float32)
        for name in ("sigma_space", "sigma_range"):
            sigma = getattr(self, name)
            in_range = float(limits.tiny) <= sigma <= float(limits.max)
            check(in_range, name, "a number > 0", sigma)
        check_radius(self.radius or 0.0)

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        layer = grid_map[self.input_layer]
        reach = 3 * self.sigma_space if self.radius is None else self.radius
        disc = Disc(reach, grid_map.resolution, grid_map.size)
        # What is missing has a value infinitely far away from all others.
        known = np.where(np.isfinite(layer), layer, np.float32(np.inf))
        margins = [(side // 2, side // 2) for side in disc.kernel.shape]
        padded = np.pad(known, margins, constant_values=np.inf)
        result = np.full_like(layer, np.nan)
        (rows, columns), (_, width) = layer.shape, disc.kernel.shape
        with np.errstate(over="ignore", invalid="ignore"):
            for part in slices(columns, _PIECE // rows):
                around = padded[:, part.start : part.stop + width - 1]
                result[:, part] = self._smooth(known[:, part], around, disc)
        result[~np.isfinite(layer)] = np.nan
        return grid_map.with_layers({self.output_layer: result})

    def _smooth(self, centre: Layer, around: Layer, disc: Disc) -> Layer:
        """Return the means of the cells `centre`; `around` has the margins of a disc more."""
        sigma = np.float32(self.sigma_range)
        weights, total = np.zeros_like(centre), np.zeros_like(centre)
        for (row, column), share in self._shares(disc):
            neighbours = around[row : row + centre.shape[0], column : column + centre.shape[1]]
            difference = np.clip((neighbours - centre) / sigma, -_FAR, _FAR)
            weight = np.exp(np.float32(-0.5) * difference * difference) * share
            weights += weight
            total += weight * difference
        total[np.abs(total) < _NOTHING * weights] = 0.0
        return centre + sigma * total / weights

    def _shares(self, disc: Disc) -> list[tuple[tuple[int, int], np.float32]]:
        """Return the cells of a disc with their weight by distance."""
        distance = np.hypot(*disc.offsets) * (disc.resolution / self.sigma_space)
        shares = np.exp(-0.5 * np.square(distance)).astype(np.float32) * (disc.kernel > 0)
        return [((row, column), shares[row, column]) for row, column in np.argwhere(shares)]
