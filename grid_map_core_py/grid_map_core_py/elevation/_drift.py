# SPDX-License-Identifier: BSD-3-Clause
"""Drift of the odometry along z: the offset between a scan and the map.

Fusing a scan with a map that is some centimeters too low would raise the cells in view a part of
the way and leave a step to the others. Therefore the whole map moves by a share of the offset, and
the scan is fused at the height of the moved map. The map lags behind the odometry by
`drift per scan / drift_compensation_alpha`.
"""

from __future__ import annotations

import numpy as np

from .._arrays._checks import Size
from ._clusters import Clusters
from ._neighbors import highest_around
from ._parameters import Parameters
from ._state import State

LEVEL = 0.03
"""Largest difference of heights [m] between a cell that votes and its eight neighbors."""


def offset(clusters: Clusters, state: State, size: Size, given: Parameters) -> float:
    """Return the height of a scan above the map [m], or 0 if the cells do not agree on it.

    A cell votes if its variance is small and its eight neighbors are known and level with it: near
    steps and edges, points and map differ without drift. Its votes are the offsets of its clusters
    within the gate and `max_drift`. The result is the mean, by inverse variances, of the votes
    within the gate of the median. At least `min_drift_cells` and half of all votes must be among
    them, and the result must not exceed `max_drift`.
    """
    heights, variances = state.heights, state.variances
    cells, threshold = clusters.points.cells[clusters.groups], given.mahalanobis_distance_threshold
    away, spread = clusters.means - heights[cells], variances[cells] + clusters.variances
    votes = np.abs(away) <= given.max_drift + threshold * np.sqrt(spread)
    votes &= variances[cells] <= given.drift_compensation_variance_inlier
    unknown = np.isnan(heights)
    highest = highest_around(np.where(unknown, np.inf, heights), size)
    lowest = -highest_around(np.where(unknown, np.inf, -heights), size)
    with np.errstate(invalid="ignore"):
        level = np.maximum(highest - heights, heights - lowest) <= LEVEL
    grid = level.reshape(size[::-1])
    grid[[0, -1]] = grid[:, [0, -1]] = False
    votes[votes] = level[cells[votes]]
    away, spread = away[votes], spread[votes]
    if len(away) < given.min_drift_cells:
        return 0.0
    agrees = np.abs(away - np.median(away)) <= threshold * np.sqrt(spread)
    if agrees.sum() < max(given.min_drift_cells, 0.5 * len(away)):
        return 0.0
    mean = float(np.average(away[agrees], weights=1.0 / spread[agrees]))
    return mean if abs(mean) <= given.max_drift else 0.0
