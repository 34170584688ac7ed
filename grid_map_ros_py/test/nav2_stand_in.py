# SPDX-License-Identifier: BSD-3-Clause
"""Stand-ins for the messages and costmaps of nav2, which need not be installed."""

import array
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import Header


@dataclass
class CostmapMetaData:
    map_load_time: Time = field(default_factory=Time)
    update_time: Time = field(default_factory=Time)
    layer: str = ""
    resolution: float = 0.0
    size_x: int = 0
    size_y: int = 0
    origin: Pose = field(default_factory=Pose)


@dataclass
class Costmap:
    header: Header = field(default_factory=Header)
    metadata: CostmapMetaData = field(default_factory=CostmapMetaData)
    data: "array.array[int]" = field(default_factory=lambda: array.array("B"))


class CostmapUpdate(SimpleNamespace):
    """Stand-in for the messages of both kinds of updates."""


OccupancyGridUpdate = CostmapUpdate


class PyCostmap2D:
    """Stand-in for `nav2_simple_commander.costmap_2d.PyCostmap2D` of Jazzy."""

    def __init__(self, grid: OccupancyGrid) -> None:
        self.size_x, self.size_y = grid.info.width, grid.info.height
        self.resolution = grid.info.resolution
        self.origin_x, self.origin_y = grid.info.origin.position.x, grid.info.origin.position.y
        self.global_frame_id, self.costmap_timestamp = grid.header.frame_id, grid.header.stamp
        self.costmap = np.array(grid.data, dtype=np.uint8)


class LaterPyCostmap2D:
    """Stand-in for the `PyCostmap2D` of Kilted and later."""

    def __init__(self, message: Costmap) -> None:
        grid, place = message.metadata, message.metadata.origin.position
        self.size_x, self.size_y, self.resolution = grid.size_x, grid.size_y, grid.resolution
        self.origin_x, self.origin_y = place.x, place.y
        self.global_frame_id = message.header.frame_id
        self.costmap_timestamp = message.header.stamp
        self.costmap = np.array(message.data, dtype=np.uint8)
