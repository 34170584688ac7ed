# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps on ROS 2: messages, bags and parts of nodes.

The names of the package are those of its rooms `messages` and `bags`, loaded on first use. Reading
messages and reading and writing bags needs neither rclpy nor message packages; making a message
needs the package of its type. `nodes` has parts for writing nodes (subscriptions,
parameters, `run`), and `testing` starts nodes for tests; both need rclpy.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from grid_map_core_py.errors import MissingPackageError

    from .bags import (
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
    from .messages import (
        ReceivedMap,
        add_color_layer_from_image,
        add_layer_from_image,
        from_costmap,
        from_grid_cells,
        from_image,
        from_message,
        from_occupancy_grid,
        from_octomap,
        from_point_cloud,
        from_polygon,
        from_pose,
        from_serialized_message,
        from_stamp,
        from_transform,
        load_octomap,
        octomap_to_points,
        read_points,
        to_color_image,
        to_costmap,
        to_flat_point_cloud,
        to_grid_cells,
        to_image,
        to_line_marker,
        to_message,
        to_occupancy_grid,
        to_point_cloud,
        to_polygon,
        to_pose,
        to_serialized_grid_cells,
        to_serialized_message,
        to_stamp,
        to_transform,
        to_triangle_list_marker,
    )

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
    "from_pose",
    "from_serialized_message",
    "from_stamp",
    "from_transform",
    "load_from_bag",
    "load_octomap",
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
    "to_pose",
    "to_serialized_grid_cells",
    "to_serialized_message",
    "to_stamp",
    "to_transform",
    "to_triangle_list_marker",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    is_bag = "bag" in name.lower()
    room = "errors" if name.endswith("Error") else "bags" if is_bag else "messages"
    value = getattr(importlib.import_module(f".{room}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
