# SPDX-License-Identifier: BSD-3-Clause
"""RViz markers that consist of lines."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap, color_value_to_vector
from grid_map_core_py.plugins import check
from grid_map_ros_py.messages import serialize
from grid_map_ros_py.messages._fields import to_header

from .colors import check_color


@dataclass(frozen=True, kw_only=True)
class LineMarker:
    """Base class of visualizations that draw single-color lines.

    Attributes:
        color: color as 0xRRGGBB.
        line_width: width of the lines [m].
    """

    message_type: ClassVar[type] = Marker

    color: int = 0xFFFFFF
    line_width: float = 0.003

    def __post_init__(self) -> None:
        check_color(self.color)
        is_width = math.isfinite(self.line_width) and self.line_width > 0
        check(is_width, "line_width", "a positive width [m]", self.line_width)

    def marker(
        self, grid_map: GridMap, points: npt.NDArray[np.float64], kind: int, namespace: str
    ) -> bytes:
        """Return a serialized line list or line strip with points (N, 3) [m] in the map frame."""
        marker = Marker(header=to_header(grid_map), ns=namespace, type=kind, action=Marker.ADD)
        marker.scale.x = self.line_width
        rgba = np.append(color_value_to_vector(self.color), np.float32(1))
        return serialize(marker, {"points": points, "colors": np.tile(rgba, (len(points), 1))})
