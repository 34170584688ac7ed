# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps on ROS 2: messages, bags and building blocks for nodes.

The package re-exports the public names of `messages` and `bags` and imports them lazily. Bags and
message decoding work without rclpy and without message packages. `nodes` contains building blocks
for your own nodes, such as subscriptions, parameters and `run`. `testing` starts nodes for tests.
`nodes` and `testing` require rclpy.
"""

from typing import TYPE_CHECKING

from grid_map_core_py._lazy import lazy_names

if TYPE_CHECKING:
    from grid_map_core_py.errors import MissingPackageError as MissingPackageError

    from .bags import (
        BagMessage as BagMessage,
        BagReader as BagReader,
        BagTopic as BagTopic,
        BagWriter as BagWriter,
        bag_maps as bag_maps,
        bag_messages as bag_messages,
        bag_topics as bag_topics,
        load_from_bag as load_from_bag,
        save_to_bag as save_to_bag,
    )
    from .errors import BagError as BagError, MessageError as MessageError
    from .messages import (
        ReceivedMap as ReceivedMap,
        add_color_layer_from_image as add_color_layer_from_image,
        add_layer_from_image as add_layer_from_image,
        apply_update as apply_update,
        from_costmap as from_costmap,
        from_grid_cells as from_grid_cells,
        from_image as from_image,
        from_message as from_message,
        from_occupancy_grid as from_occupancy_grid,
        from_octomap as from_octomap,
        from_point_cloud as from_point_cloud,
        from_polygon as from_polygon,
        from_pose as from_pose,
        from_serialized_message as from_serialized_message,
        from_stamp as from_stamp,
        from_transform as from_transform,
        load_octomap as load_octomap,
        octomap_to_points as octomap_to_points,
        read_points as read_points,
        to_color_image as to_color_image,
        to_costmap as to_costmap,
        to_costmap_update as to_costmap_update,
        to_flat_point_cloud as to_flat_point_cloud,
        to_grid_cells as to_grid_cells,
        to_image as to_image,
        to_line_marker as to_line_marker,
        to_message as to_message,
        to_occupancy_grid as to_occupancy_grid,
        to_occupancy_grid_update as to_occupancy_grid_update,
        to_point_cloud as to_point_cloud,
        to_polygon as to_polygon,
        to_pose as to_pose,
        to_serialized_grid_cells as to_serialized_grid_cells,
        to_serialized_message as to_serialized_message,
        to_stamp as to_stamp,
        to_transform as to_transform,
        to_triangle_list_marker as to_triangle_list_marker,
    )

_OFFERED = {
    ".bags": "BagMessage BagReader BagTopic BagWriter bag_maps bag_messages bag_topics "
    "load_from_bag save_to_bag",
    ".errors": "BagError MessageError MissingPackageError",
    ".messages": "ReceivedMap add_color_layer_from_image add_layer_from_image apply_update "
    "from_costmap from_grid_cells from_image from_message from_occupancy_grid from_octomap "
    "from_point_cloud from_polygon from_pose from_serialized_message from_stamp from_transform "
    "load_octomap octomap_to_points read_points to_color_image to_costmap to_costmap_update "
    "to_flat_point_cloud to_grid_cells to_image to_line_marker to_message to_occupancy_grid "
    "to_occupancy_grid_update to_point_cloud to_polygon to_pose to_serialized_grid_cells "
    "to_serialized_message to_stamp to_transform to_triangle_list_marker",
}
__all__, __getattr__, __dir__ = lazy_names(__name__, _OFFERED)
