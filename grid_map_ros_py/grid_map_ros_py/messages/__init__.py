# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between grid maps and ROS messages."""

from ._cdr import serialize, view
from ._costmap import OCCUPANCIES, from_costmap, to_costmap
from ._grid_cells import from_grid_cells, to_grid_cells, to_serialized_grid_cells
from ._grid_map import (
    ReceivedMap,
    from_message,
    from_serialized_message,
    to_message,
    to_serialized_message,
)
from ._image import (
    ENCODINGS,
    add_color_layer_from_image,
    add_layer_from_image,
    from_image,
    to_color_image,
    to_image,
    to_pixels,
)
from ._multi_array import from_multi_array, set_array, to_multi_array
from ._occupancy_grid import from_occupancy_grid, occupancies, to_occupancy_grid
from ._octomap import from_octomap, load_octomap, octomap_to_points
from ._point_cloud import (
    from_point_cloud,
    read_columns,
    read_points,
    to_flat_point_cloud,
    to_point_cloud,
)
from ._polygon import (
    from_polygon,
    to_line_marker,
    to_polygon,
    to_triangle_list_marker,
)
from ._pose import from_pose, from_transform, to_pose, to_transform
from ._time import from_stamp, to_header, to_stamp

__all__ = [
    "ENCODINGS",
    "OCCUPANCIES",
    "ReceivedMap",
    "add_color_layer_from_image",
    "add_layer_from_image",
    "from_costmap",
    "from_grid_cells",
    "from_image",
    "from_message",
    "from_multi_array",
    "from_occupancy_grid",
    "from_octomap",
    "from_point_cloud",
    "from_polygon",
    "from_pose",
    "from_serialized_message",
    "from_stamp",
    "from_transform",
    "load_octomap",
    "occupancies",
    "octomap_to_points",
    "read_columns",
    "read_points",
    "serialize",
    "set_array",
    "to_color_image",
    "to_costmap",
    "to_flat_point_cloud",
    "to_grid_cells",
    "to_header",
    "to_image",
    "to_line_marker",
    "to_message",
    "to_multi_array",
    "to_occupancy_grid",
    "to_pixels",
    "to_point_cloud",
    "to_polygon",
    "to_pose",
    "to_serialized_grid_cells",
    "to_serialized_message",
    "to_stamp",
    "to_transform",
    "to_triangle_list_marker",
    "view",
]
