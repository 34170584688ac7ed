# SPDX-License-Identifier: BSD-3-Clause
"""Drift of the odometry along z: the offset between a scan and the map.

If a scan is fused while the map is too low by some centimeters, its cells follow a part of the way,
and cells out of view stay behind: a step. Therefore the map as a whole moves by a share of the
offset, and the scan is fused at the height of the moved map. The map lags behind the odometry by
`drift per scan / drift_compensation_alpha`, everywhere by the same.
"""

from __future__ import annotations

import numpy as np

from .._arrays._checks import Mask, Size
from ._clusters import Clusters
from ._neighbors import highest_around
from ._parameters import Parameters
from ._sensors import Numbers
from ._state import State

LEVEL = 0.03
"""Largest difference of heights [m] between a cell that votes and its eight neighbors."""


def offset(clusters: Clusters, state: State, size: Size, given: Parameters) -> float:
    """Return how much higher than the map a scan is [m], 0 if the cells do not agree on that.

    Cells of small variance vote whose eight neighbors are known and level with them: near steps and
    edges, points and map differ without drift. They see the offsets of their clusters that are
    within the gate and `max_drift` of their heights. Offsets agree that are within the gate of the
    median. There have to be enough of them, more than half of all, and the result, their mean by
    inverse variances, has to be below `max_drift`.

    Args:
        clusters: the clusters of the scan.
        state: the map.
        size: rows and columns of the map.
        given: parameters.
    """
    heights, variances = state.heights, state.variances
    cells, threshold = clusters.points.cells[clusters.groups], given.mahalanobis_distance_threshold
    away, spread = clusters.means - heights[cells], variances[cells] + clusters.variances
    votes = np.abs(away) <= given.max_drift + threshold * np.sqrt(spread)
    votes &= variances[cells] <= given.drift_compensation_variance_inlier
    votes[votes] = _is_level(heights, size)[cells[votes]]
    away, spread = away[votes], spread[votes]
    if len(away) < given.min_drift_cells:
        return 0.0
    agrees = np.abs(away - np.median(away)) <= threshold * np.sqrt(spread)
    if agrees.sum() < max(given.min_drift_cells, 0.5 * len(away)):
        return 0.0
    mean = float(np.average(away[agrees], weights=1.0 / spread[agrees]))
    return mean if abs(mean) <= given.max_drift else 0.0


def _is_level(heights: Numbers, size: Size) -> Mask:
    """Return which cells (cells,) are level with eight neighbors, all of which are known."""
    unknown = np.isnan(heights)
    highest = highest_around(np.where(unknown, np.inf, heights), size)
    lowest = -highest_around(np.where(unknown, np.inf, -heights), size)
    with np.errstate(invalid="ignore"):
        level: Mask = np.maximum(highest - heights, heights - lowest) <= LEVEL
    grid = level.reshape(size[::-1])
    grid[[0, -1]] = grid[:, [0, -1]] = False
    return level
