# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/BilateralFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py._arrays import Layer, slices
from grid_map_core_py.plugins import check

from ..parts._disc import Disc, disc_reach
from ..parts._layer_filter import LayerFilter, check_radius
from ..parts._side_by_side import side_by_side

# OpenCV's bilateral filter is unsuitable: it propagates NaN, and a single outlier makes its weight
# table too coarse to preserve edges.

_FAR = np.float32(12.0)
"""Limit to which value differences are clipped [standard deviations]. A clipped difference, such as
one to a missing value, has the weight 5e-32."""

_NOTHING = np.float32(1e-26)
"""Mean differences below this limit [standard deviations] become 0; missing values cause them."""

_PIECE = 2**16
"""Number of cells computed at once, small enough that temporary arrays fit into the cache."""


@dataclass(frozen=True, kw_only=True)
class Bilateral(LayerFilter):
    """Smooth a layer while preserving edges.

    Each finite cell becomes the weighted mean of the finite values in the surrounding disc. The
    weight is the product of a Gaussian of the distance and a Gaussian of the value difference
    (C. Tomasi and R. Manduchi, "Bilateral filtering for gray and color images", ICCV 1998).
    Non-finite cells become NaN.

    Attributes:
        sigma_space: standard deviation of the Gaussian over distance [m].
        sigma_range: standard deviation of the Gaussian over value differences, in the unit of the
            layer. Steps much higher than `sigma_range` stay sharp.
        radius: radius of the disc [m]; by default 3 times `sigma_space`.
    """

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

    def reach(self, resolution: float) -> float:
        return disc_reach(self._radius, resolution)

    def _filter(self, layer: Layer, resolution: float) -> Layer:
        disc = Disc(self._radius, resolution, layer.shape)
        # Missing values are set to infinity, so that their weight is 0.
        known = np.where(np.isfinite(layer), layer, np.float32(np.inf))
        margins = [(side // 2, side // 2) for side in disc.kernel.shape]
        padded = np.pad(known, margins, constant_values=np.inf)
        result = np.full_like(layer, np.nan)
        (rows, columns), (_, width) = layer.shape, disc.kernel.shape

        def smooth(part: slice) -> None:
            around = padded[:, part.start : part.stop + width - 1]
            result[:, part] = self._smooth(known[:, part], around, disc)

        with np.errstate(over="ignore", invalid="ignore"):
            side_by_side(smooth, slices(columns, _PIECE // rows))
        result[~np.isfinite(layer)] = np.nan
        return result

    def _smooth(self, center: Layer, around: Layer, disc: Disc) -> Layer:
        """Return the weighted means of the block `center`; `around` is the padded block."""
        sigma, (rows, columns) = np.float32(self.sigma_range), center.shape
        # The cell itself has weight 1.
        weights, total = np.ones_like(center), np.zeros_like(center)
        distance = np.hypot(*disc.offsets) * (disc.resolution / self.sigma_space)
        shares = np.exp(-0.5 * np.square(distance)).astype(np.float32) * (disc.kernel > 0)
        top, left = disc.reach
        # Each pair of cells is computed once, because the weight is symmetric and the difference
        # antisymmetric. `first` and `second` are the two cells of every pair with a cell in
        # `center`.
        pairs = [at for at in np.argwhere(shares) - disc.reach if tuple(at) > (0, 0)]
        for down, right in pairs:
            start, stop = left - max(right, 0), left + columns - min(right, 0)
            first = around[top - down : top + rows, start:stop]
            second = around[top : top + rows + down, start + right : stop + right]
            difference = second - first
            difference /= sigma
            np.clip(difference, -_FAR, _FAR, out=difference)
            weight = np.float32(-0.5) * difference
            weight *= difference
            np.exp(weight, out=weight)
            weight *= shares[top + down, left + right]
            difference *= weight
            ahead = slice(down, None), slice(max(right, 0), max(right, 0) + columns)
            behind = slice(rows), slice(max(-right, 0), max(-right, 0) + columns)
            weights += weight[ahead]
            weights += weight[behind]
            total += difference[ahead]
            total -= difference[behind]
        total[np.abs(total) < _NOTHING * weights] = 0.0
        return center + sigma * total / weights

    @property
    def _radius(self) -> float:
        return 3 * self.sigma_space if self.radius is None else self.radius
