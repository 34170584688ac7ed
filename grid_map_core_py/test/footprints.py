# SPDX-License-Identifier: BSD-3-Clause
"""Footprints for tests, and the cells that they touch by a slow oracle."""

import math

import numpy as np
from hypothesis import strategies as st

from grid_map_core_py import Polygon
from grid_map_core_py.planning import Footprint

ROBOT = Footprint.rectangle(0.9, 0.5)
ELL = Footprint([(0.0, 0.0), (0.7, 0.0), (0.7, 0.2), (0.2, 0.2), (0.2, 0.6), (0.0, 0.6)])
FORK = Footprint([(-0.3, 0), (0.5, -0.3), (0.5, -0.2), (0.0, 0.0), (0.5, 0.2), (0.5, 0.3)])
MARGIN = 2e-9
"""Distance [m] within which a footprint only touches a cell, which counts or not."""


def corners_at(footprint, pose):
    x, y, yaw = pose
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return footprint.points @ turn.T + (x, y)


def meets_square(corners, center, half):
    """Oracle: an edge is partly in the square, or the center of the square is in the polygon."""
    if half <= 0:
        return False
    for begin, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        # Clip the edge to the two strips that contain the square (Liang and Barsky).
        enter, leave = 0.0, 1.0
        for start, along in zip(begin - center, end - begin, strict=True):
            if along == 0:
                enter, leave = (enter, leave) if abs(start) < half else (1.0, 0.0)
                continue
            crossings = sorted([(-half - start) / along, (half - start) / along])
            enter, leave = max(enter, crossings[0]), min(leave, crossings[1])
        if enter < leave:
            return True
    return bool(Polygon(corners).is_inside(center))


def touched_by_hand(corners, centers, resolution):
    """Return the numbers of the cells that are surely touched, and of those that may count."""
    surely, perhaps = (
        {
            number
            for number, center in enumerate(centers)
            if meets_square(corners, center, 0.5 * resolution + margin)
        }
        for margin in (-MARGIN, MARGIN)
    )
    return surely, perhaps


@st.composite
def footprints(draw):
    """Stars around a point: convex or not, some without the origin inside."""
    count = draw(st.integers(3, 9))
    angles = 2 * np.pi * (np.arange(count) + draw(st.floats(0, 0.9))) / count
    radii = draw(st.lists(st.floats(0.02, 0.8), min_size=count, max_size=count))
    offset = draw(st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)))
    return Footprint(np.transpose(radii * np.array([np.cos(angles), np.sin(angles)])) + offset)


yaws = st.floats(-7, 7) | st.sampled_from([0.0, np.pi / 2, -np.pi, 0.5])
