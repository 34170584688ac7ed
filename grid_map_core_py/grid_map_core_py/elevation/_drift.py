# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Drift of the odometry along z: the offset between a scan and the map.

If a scan is fused while the map is too low by some centimeters, its cells follow a part of the way,
and cells out of view stay behind: a step. Therefore the map as a whole moves by a share of the
offset, and the scan is fused at the height of the moved map. The map lags behind the odometry by
`drift per scan / drift_compensation_alpha`, everywhere by the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._order import Sorted
from ._sensors import Numbers


@dataclass(frozen=True)
class DriftRules:
    """Numbers of the compensation, as in `Parameters`."""

    threshold: float
    max_drift: float
    largest_variance: float
    min_cells: int


def offset(points: Sorted, heights: Numbers, variances: Numbers, rules: DriftRules) -> float:
    """Return how much higher than the map a scan is [m], 0 if the cells do not agree on that.

    A cell of small variance sees the mean offset of its points that are within the gate and
    `max_drift` of its height. Cells agree that are within the gate of the median offset. There have
    to be enough of them, more than half of all, and the result, their mean by inverse variances,
    has to be below `max_drift`.

    Args:
        points: the points on the map.
        heights, variances: (cells,) of the map.
        rules: numbers of the compensation.
    """
    groups, cells = points.groups, points.cells
    height, variance = heights[cells], variances[cells]
    certain = variance <= rules.largest_variance
    away = points.heights - height[groups]
    near = rules.max_drift + rules.threshold * np.sqrt(variance[groups] + points.variances)
    chosen = certain[groups] & (np.abs(away) <= near)
    groups, weights = groups[chosen], 1.0 / points.variances[chosen]
    weight = np.bincount(groups, weights, len(cells))
    seen = np.flatnonzero(weight)
    if len(seen) < rules.min_cells:
        return 0.0
    offsets = np.bincount(groups, weights * away[chosen], len(cells))[seen] / weight[seen]
    spread = variance[seen] + 1.0 / weight[seen]
    agrees = np.abs(offsets - np.median(offsets)) <= rules.threshold * np.sqrt(spread)
    if agrees.sum() < max(rules.min_cells, 0.5 * len(seen)):
        return 0.0
    weights = 1.0 / spread[agrees]
    mean = float((weights * offsets[agrees]).sum() / weights.sum())
    return mean if abs(mean) <= rules.max_drift else 0.0
