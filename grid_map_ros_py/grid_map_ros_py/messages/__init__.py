# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between grid maps and ROS messages.

Every message is validated before memory is allocated for the map. The conversions raise these
errors:

- `MessageError`: a message is invalid, or a value cannot be stored in a message.
- `LayerNotFoundError`: the map lacks a layer.
- `LimitError`: a map has too many cells.
- `MissingPackageError`: a message package is not installed.
- `GridMapError`: an argument is invalid.
"""

from grid_map_core_py import _lazy

from ._cdr import serialize as serialize, view as view
from ._costmap import (
    OCCUPANCIES as OCCUPANCIES,
    STATIC_LAYER as STATIC_LAYER,
    from_costmap as from_costmap,
    to_costmap as to_costmap,
)
from ._fields import (
    from_pose as from_pose,
    from_stamp as from_stamp,
    from_transform as from_transform,
    to_pose as to_pose,
    to_stamp as to_stamp,
    to_transform as to_transform,
)
from ._grid_cells import (
    from_grid_cells as from_grid_cells,
    to_grid_cells as to_grid_cells,
    to_serialized_grid_cells as to_serialized_grid_cells,
)
from ._grid_map import (
    ReceivedMap as ReceivedMap,
    from_message as from_message,
    from_serialized_message as from_serialized_message,
    to_message as to_message,
    to_serialized_message as to_serialized_message,
)
from ._image import (
    add_color_layer_from_image as add_color_layer_from_image,
    add_layer_from_image as add_layer_from_image,
    from_image as from_image,
    to_color_image as to_color_image,
    to_image as to_image,
)
from ._occupancy_grid import (
    from_occupancy_grid as from_occupancy_grid,
    to_occupancy_grid as to_occupancy_grid,
)
from ._octomap import (
    from_octomap as from_octomap,
    load_octomap as load_octomap,
    octomap_to_points as octomap_to_points,
)
from ._point_cloud import (
    from_point_cloud as from_point_cloud,
    read_points as read_points,
    to_flat_point_cloud as to_flat_point_cloud,
    to_point_cloud as to_point_cloud,
)
from ._polygon import (
    from_polygon as from_polygon,
    to_line_marker as to_line_marker,
    to_polygon as to_polygon,
    to_triangle_list_marker as to_triangle_list_marker,
)
from ._updates import (
    apply_update as apply_update,
    to_costmap_update as to_costmap_update,
    to_occupancy_grid_update as to_occupancy_grid_update,
)

__all__, __dir__ = _lazy.public_names(dir())
