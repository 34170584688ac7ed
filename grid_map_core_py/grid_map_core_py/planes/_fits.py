# SPDX-License-Identifier: BSD-3-Clause
"""Least-squares planes of many groups of cells at once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


class Fit(NamedTuple):
    """Planes z = height + slopes . (position - center) of G groups of cells.

    Attributes:
        counts: (G,) number of cells.
        centers: (G, 2) mean positions.
        heights: (G,) heights at the centers; NaN for groups without a unique plane.
        slopes: (G, 2) slopes along both coordinates.
        squares: (G,) sums of the squared residuals, weighted.
        covariances: (G, 3, 3) of height at the center and slopes, for weights 1 / variance.
    """

    counts: Numbers
    centers: Numbers
    heights: Numbers
    slopes: Numbers
    squares: Numbers
    covariances: Numbers

    def at(self, groups: NDArray[Any], x: Numbers, y: Numbers) -> Numbers:
        """Return the heights (N,) of the planes of `groups` (N,) at positions x, y (N,)."""
        offsets = self.heights - (self.slopes * self.centers).sum(axis=1)
        along: Numbers = self.slopes[groups, 0] * x + self.slopes[groups, 1] * y
        along += offsets[groups]
        return along


def fit_planes(
    groups: NDArray[Any],
    count: int,
    points: tuple[Numbers, Numbers, Numbers],
    weights: Numbers | None = None,
) -> Fit:
    """Fit a plane to each group of points: weighted least squares, all groups in one pass.

    Args:
        groups: (N,) number of the group of each point, 0 to `count` - 1.
        count: number of groups G.
        points: x, y, z, each (N,).
        weights: (N,) positive weights; None means 1.
    """
    x, y, z = points
    reference = float(z[0]) if z.size else 0.0  # keeps the precision of sums at large heights
    z = z - reference

    def sums(values: Numbers, factor: Numbers | float = 1.0) -> Any:
        return np.bincount(groups, values * factor, count)

    counts = np.bincount(groups, minlength=count).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = np.stack([sums(x), sums(y)], axis=1) / counts[:, None]
        wx, wy, wz = (x, y, z) if weights is None else (weights * x, weights * y, weights * z)
        total = counts if weights is None else sums(weights)
        mx, my, mz = sums(wx) / total, sums(wy) / total, sums(wz) / total
        xx, yy = sums(wx, x) - total * mx**2, sums(wy, y) - total * my**2
        xy = sums(wx, y) - total * mx * my
        xz, yz = sums(wx, z) - total * mx * mz, sums(wy, z) - total * my * mz
        determinant = xx * yy - xy**2
        # Collinear cells define no plane.
        determinant[~(determinant > 1e-9 * xx * yy)] = np.nan
        slopes = np.stack([yy * xz - xy * yz, xx * yz - xy * xz], axis=1) / determinant[:, None]
        squares = sums(wz, z) - total * mz**2 - slopes[:, 0] * xz - slopes[:, 1] * yz
        # Covariance at the weighted mean, then at the plain mean of the positions.
        dx, dy = means[:, 0] - mx, means[:, 1] - my
        a, b, c = yy / determinant, -xy / determinant, xx / determinant
        covariances = np.empty((count, 3, 3))
        covariances[:, 1, 1], covariances[:, 2, 2] = a, c
        covariances[:, 1, 2] = covariances[:, 2, 1] = b
        covariances[:, 0, 1] = covariances[:, 1, 0] = a * dx + b * dy
        covariances[:, 0, 2] = covariances[:, 2, 0] = b * dx + c * dy
        covariances[:, 0, 0] = 1 / total + a * dx**2 + 2 * b * dx * dy + c * dy**2
    heights = reference + mz + slopes[:, 0] * dx + slopes[:, 1] * dy
    return Fit(counts, means, heights, slopes, np.maximum(squares, 0.0), covariances)
