# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Definition of `grid_map_msgs/GridMap`, for bags and for serialization without ROS."""

import re
from collections.abc import Iterable, Mapping

GRID_MAP = "grid_map_msgs/GridMap"

TYPE_HASH = "RIHS01_343b0e72887541beda6b035cc053f2d6fffaad9d6dcb2773c15a808dfca31fde"
"""Type hash (REP-2011) of `grid_map_msgs/msg/GridMap`."""

_LINES = {
    GRID_MAP: (
        "std_msgs/Header header",
        "GridMapInfo info",
        "string[] layers",
        "string[] basic_layers",
        "std_msgs/Float32MultiArray[] data",
        "uint16 outer_start_index",
        "uint16 inner_start_index",
    ),
    "grid_map_msgs/GridMapInfo": (
        "float64 resolution",
        "float64 length_x",
        "float64 length_y",
        "geometry_msgs/Pose pose",
    ),
    "std_msgs/Header": ("builtin_interfaces/Time stamp", "string frame_id"),
    "builtin_interfaces/Time": ("int32 sec", "uint32 nanosec"),
    "geometry_msgs/Pose": ("Point position", "Quaternion orientation"),
    "geometry_msgs/Point": ("float64 x", "float64 y", "float64 z"),
    "geometry_msgs/Quaternion": ("float64 x 0", "float64 y 0", "float64 z 0", "float64 w 1"),
    "std_msgs/Float32MultiArray": ("MultiArrayLayout layout", "float32[] data"),
    "std_msgs/MultiArrayLayout": ("MultiArrayDimension[] dim", "uint32 data_offset"),
    "std_msgs/MultiArrayDimension": ("string label", "uint32 size", "uint32 stride"),
}
"""Lines of the `.msg` files, by type."""

DEFINITION = f"\n{'=' * 80}\n".join(
    "\n".join((*([] if name == GRID_MAP else [f"MSG: {name}"]), *lines, ""))
    for name, lines in _LINES.items()
).rstrip("\n")
"""Definition with those of all nested types (the schema `ros2msg` of MCAP), without comments."""


def _fields(package: str, lines: Iterable[str]) -> Mapping[str, str]:
    """Return the types of fields as `get_fields_and_field_types` of a message class does."""
    fields = {}
    for line in lines:
        kind, name, *_ = line.split()
        item = kind.removesuffix("[]").replace("float64", "double").replace("float32", "float")
        if re.match("[A-Z]", item):
            item = f"{package}/{item}"
        fields[name] = f"sequence<{item}>" if kind.endswith("[]") else item
    return fields


FIELDS_BY_TYPE = {name: _fields(name.partition("/")[0], lines) for name, lines in _LINES.items()}
"""Names and types of the fields of `grid_map_msgs/GridMap` and of all messages in it."""
