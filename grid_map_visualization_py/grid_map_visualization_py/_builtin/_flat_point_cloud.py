# SPDX-License-Identifier: BSD-3-Clause
"""Point cloud of the cells at a constant height, with every layer as a field."""

import math
from dataclasses import dataclass
from typing import ClassVar

from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check
from grid_map_ros_py.messages import to_flat_point_cloud


@dataclass(frozen=True, kw_only=True)
class FlatPointCloudVisualization:
    """Draw cells as points at a constant height.

    Attributes:
        height: height of the points [m].
    """

    message_type: ClassVar[type] = PointCloud2

    height: float = 0.0

    def __post_init__(self) -> None:
        check(math.isfinite(self.height), "height", "a finite number", self.height)

    def __call__(self, grid_map: GridMap) -> PointCloud2:
        return to_flat_point_cloud(grid_map, self.height)
