# SPDX-License-Identifier: BSD-3-Clause
"""Outline of the map."""

from dataclasses import dataclass

import numpy as np
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap

from .._markers import LineMarker

_CORNERS = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1)])


@dataclass(frozen=True, kw_only=True)
class MapRegionVisualization(LineMarker):
    """Draw the map border as a closed line at height zero."""

    def __call__(self, grid_map: GridMap) -> bytes:
        # Round to single precision like the C++ node, so that the points are bitwise equal.
        half_length = (grid_map.length / 2).astype(np.float32).astype(np.float64)
        points = np.zeros((len(_CORNERS), 3))
        points[:, :2] = grid_map.position + _CORNERS * half_length
        return self.marker(grid_map, points, Marker.LINE_STRIP, "map_region")
