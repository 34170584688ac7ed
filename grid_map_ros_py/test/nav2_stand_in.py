# SPDX-License-Identifier: BSD-3-Clause
"""Stand-ins for the messages and costmaps of nav2, which need not be installed."""

import array
from dataclasses import dataclass, field

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose
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


class PyCostmap2D:
    """Stand-in for `nav2_simple_commander.costmap_2d.PyCostmap2D`."""

    def __init__(self, message: Costmap) -> None:
        self.size_x = message.metadata.size_x
        self.size_y = message.metadata.size_y
        self.resolution = message.metadata.resolution
        self.origin_x = message.metadata.origin.position.x
        self.origin_y = message.metadata.origin.position.y
        self.global_frame_id = message.header.frame_id
        self.costmap_timestamp = message.header.stamp
        self.costmap = np.array(message.data, dtype=np.uint8)
