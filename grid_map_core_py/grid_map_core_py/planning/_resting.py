# SPDX-License-Identifier: BSD-3-Clause
"""Resting pose of a flat sole on uneven ground."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .._arrays._checks import Positions

_ON_A_LINE = 1e-9
"""Share of the spread of points below which their spread in another direction is zero."""


class Resting(NamedTuple):
    """Height [m], roll and pitch [rad] of a sole, and clearance [m]; see `PoseCheck`."""

    height: float
    roll: float
    pitch: float
    clearance: float


NOT_RESTING = Resting(*(math.nan,) * 4)


def resting_pose(points: Positions, yaw: float, resolution: float, body_height: float) -> Resting:
    """Return how a sole rests on points; see `check_pose`.

    The convex hull is the intersection of half spaces, so the lowest of the planes of its upper
    facets, at a position, is the plane of the facet there.

    Args:
        points: (N, 3) finite x, y relative to the robot [m], map frame, and height [m].
        yaw: direction of the robot [rad].
        resolution: side of a cell [m].
        body_height: height of the body above the sole [m]; NaN is unknown.
    """
    from scipy.spatial import ConvexHull  # slow to import

    if not len(points):
        return NOT_RESTING
    middle = points[:, :2].mean(axis=0)
    top, bottom = points[:, 2].max(), points[:, 2].min()
    local = points - (*middle, top)
    local[:, :2] /= resolution
    scale = max(top - bottom, resolution)
    local[:, 2] /= scale
    spreads, directions = np.linalg.eigh(local[:, :2].T @ local[:, :2])
    for spread, direction in zip(spreads, directions.T, strict=True):
        if spread <= _ON_A_LINE * max(spreads[1], 1.0):
            across = np.append(direction, 0.0)
            local = np.concatenate((local + across, local - across))
    # With a point below the others, the hull of level ground has a volume, too.
    equations = ConvexHull(np.concatenate((local, [(0.0, 0.0, -2.0)]))).equations
    upper = equations[equations[:, 2] > 0.0]
    (x, y, z, offset) = upper[np.argmin(-upper[:, 3] / upper[:, 2])]
    slope = -scale / (resolution * z) * np.array([x, y])
    height = top - scale * offset / z - slope @ middle
    ahead = slope @ (math.cos(yaw), math.sin(yaw))
    left = slope @ (-math.sin(yaw), math.cos(yaw))
    # The normal (-ahead, -left, 1) is the z axis turned by the roll, then by the pitch.
    roll = math.asin(left / math.sqrt(1.0 + ahead**2 + left**2))
    return Resting(float(height), roll, -math.atan(ahead), float(height + body_height - top))
