# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps on ROS 2: conversions between `GridMap` and messages.

Importing this package needs the message packages alone: the conversions work without a node and
without rclpy. What nodes need beside them is imported by name: `qos` (profiles of map topics),
`parameters` (typed parameters of the ordinary parameter file), `throttle` (what to log again),
`spin` (the life of an executable), `testing` (processes and peers for tests of nodes).
"""

from grid_map_core_py.errors import MissingPackageError

from .bags._bag import (
    BagReader,
    BagRecord,
    BagTopic,
    BagWriter,
    bag_maps,
    bag_topics,
    load_from_bag,
    save_to_bag,
)
from .errors import BagError, MessageError
from .messages._costmap import from_costmap, to_costmap
from .messages._grid_cells import from_grid_cells, to_grid_cells, to_serialized_grid_cells
from .messages._grid_map import from_message, to_message
from .messages._image import (
    add_color_layer_from_image,
    add_layer_from_image,
    from_image,
    to_color_image,
    to_image,
)
from .messages._occupancy_grid import from_occupancy_grid, to_occupancy_grid
from .messages._octomap import from_octomap, octomap_to_points
from .messages._point_cloud import to_flat_point_cloud, to_point_cloud
from .messages._point_cloud_reading import from_point_cloud, read_points
from .messages._polygon import (
    from_polygon,
    to_line_marker,
    to_polygon,
    to_serialized_line_marker,
    to_serialized_polygon,
    to_serialized_triangle_list_marker,
    to_triangle_list_marker,
)
from .messages._serialized import ReceivedMap, from_serialized_message, to_serialized_message

__version__ = "0.2.0"

__all__ = [
    "BagError",
    "BagReader",
    "BagRecord",
    "BagTopic",
    "BagWriter",
    "MessageError",
    "MissingPackageError",
    "ReceivedMap",
    "add_color_layer_from_image",
    "add_layer_from_image",
    "bag_maps",
    "bag_topics",
    "from_costmap",
    "from_grid_cells",
    "from_image",
    "from_message",
    "from_occupancy_grid",
    "from_octomap",
    "from_point_cloud",
    "from_polygon",
    "from_serialized_message",
    "load_from_bag",
    "octomap_to_points",
    "read_points",
    "save_to_bag",
    "to_color_image",
    "to_costmap",
    "to_flat_point_cloud",
    "to_grid_cells",
    "to_image",
    "to_line_marker",
    "to_message",
    "to_occupancy_grid",
    "to_point_cloud",
    "to_polygon",
    "to_serialized_grid_cells",
    "to_serialized_line_marker",
    "to_serialized_message",
    "to_serialized_polygon",
    "to_serialized_triangle_list_marker",
    "to_triangle_list_marker",
]
