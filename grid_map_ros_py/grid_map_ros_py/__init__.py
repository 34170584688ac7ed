# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps on ROS 2: conversions between `GridMap` and messages.

Importing this package needs the message packages alone: the conversions work without a node and
without rclpy. What nodes need beside them is imported by name: `qos` (profiles of map topics),
`parameters` (typed parameters of the ordinary parameter file), `throttle` (what to log again),
`spin` (the life of an executable), `testing` (processes and peers for tests of nodes).
"""

from .errors import MessageError
from .grid_cells import to_grid_cells, to_serialized_grid_cells
from .grid_map import from_message, to_message
from .occupancy_grid import from_occupancy_grid, to_occupancy_grid
from .point_cloud import to_flat_point_cloud, to_point_cloud

__all__ = [
    "MessageError",
    "from_message",
    "from_occupancy_grid",
    "to_flat_point_cloud",
    "to_grid_cells",
    "to_message",
    "to_occupancy_grid",
    "to_point_cloud",
    "to_serialized_grid_cells",
]
