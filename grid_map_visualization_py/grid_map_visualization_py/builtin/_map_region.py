# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Outline of the map."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap

from .._markers import check_line, line_marker

_CORNERS = np.array([(1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1)])


@dataclass(frozen=True, kw_only=True)
class MapRegionVisualization:
    """Draw the border of the map as a closed line at height zero.

    Attributes:
        color: 0xRRGGBB.
        line_width: width of the line [m].

    Raises:
        ConfigError: the color is out of range, or the width not positive.
    """

    message_type: ClassVar[type] = Marker

    color: int = 0xFFFFFF
    line_width: float = 0.003

    def __post_init__(self) -> None:
        check_line(self.color, self.line_width)

    def __call__(self, grid_map: GridMap) -> bytes:
        """Return the marker, serialized."""
        # Single precision as in the C++ node, so that the points are equal bit by bit.
        half_length = (grid_map.length / 2).astype(np.float32).astype(np.float64)
        points = np.zeros((len(_CORNERS), 3))
        points[:, :2] = grid_map.position + _CORNERS * half_length
        return line_marker(
            grid_map,
            points,
            kind=Marker.LINE_STRIP,
            namespace="map_region",
            color=self.color,
            line_width=self.line_width,
        )
