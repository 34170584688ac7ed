# SPDX-License-Identifier: BSD-3-Clause
"""Point cloud of the cells, with every layer as a field."""

from dataclasses import dataclass
from typing import ClassVar

from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridMap
from grid_map_ros_py.messages import to_point_cloud

from ._flat_point_cloud import FlatPointCloudVisualization


@dataclass(frozen=True, kw_only=True)
class PointCloudVisualization:
    """Draw cells as points at the heights in a layer.

    Attributes:
        layer: layer with the heights [m]; cells without a finite height are omitted.
        flat: draw the cells at height zero, even those without a height.
    """

    message_type: ClassVar[type] = PointCloud2

    layer: str = "elevation"
    flat: bool = False

    def __call__(self, grid_map: GridMap) -> PointCloud2:
        if self.flat:
            return FlatPointCloudVisualization()(grid_map)
        return to_point_cloud(grid_map, self.layer)
