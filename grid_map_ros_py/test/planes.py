# SPDX-License-Identifier: BSD-3-Clause
"""A map with planes: tread, higher tread with a hole, and ramp; and readers of their messages."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.planes import PlanarRegion, PlanarRegions, extract_planes
from grid_map_core_py.testing import moved_in_buffer


def steps(shift: float = 0.0, *, higher: bool = True, frame_id: str = "odom") -> GridMap:
    """Return 50 x 41 cells of 4 cm, stored as if moved, around x = `shift`.

    Args:
        shift: x of the center of the map; the planes stay where they are [m].
        higher: whether the higher tread is there.
        frame_id: frame of the map.
    """
    geometry = {"position": (shift, 0.0), "frame_id": frame_id, "timestamp": 12_000_000_034}
    grid_map = GridMap((2.0, 1.64), 0.04, **geometry)
    x, y = np.meshgrid(*grid_map.axes(), indexing="ij")
    heights = np.where(x < -0.32, 0.1, np.where(x < 0.32, 0.3 if higher else np.nan, 0.3 * x + 0.4))
    heights[np.hypot(x, y) < 0.1] = np.nan
    grid_map["elevation"] = heights
    grid_map["color"] = x
    grid_map.basic_layers = ["elevation"]
    return moved_in_buffer(grid_map, (7, 11))


def regions_of(*maps: GridMap) -> PlanarRegions:
    """Return the regions of the last of successive maps."""
    regions = None
    for grid_map in maps:
        regions = extract_planes(grid_map, previous=regions)
    return regions


def points_of(points: Sequence[Any]) -> np.ndarray:
    """Return the points (N, 3) of a message."""
    return np.array([(point.x, point.y, point.z) for point in points]).reshape(-1, 3)


def is_on(region: PlanarRegion, points: np.ndarray) -> bool:
    """Return whether all points (N, 3) are on the plane of a region."""
    return bool((abs(points @ region.normal - region.offset) < 1e-6).all())
