# SPDX-License-Identifier: BSD-3-Clause
"""Definitions of the message types that can be read and written without ROS."""

import re
from collections.abc import Iterable, Mapping
from itertools import islice

GRID_MAP = "grid_map_msgs/GridMap"

TYPE_HASH = "RIHS01_343b0e72887541beda6b035cc053f2d6fffaad9d6dcb2773c15a808dfca31fde"
"""Type hash (REP-2011) of `grid_map_msgs/msg/GridMap`."""

_DEFINITIONS = """
grid_map_msgs/GridMap: std_msgs/Header header; GridMapInfo info; string[] layers;
    string[] basic_layers; std_msgs/Float32MultiArray[] data; uint16 outer_start_index;
    uint16 inner_start_index
grid_map_msgs/GridMapInfo: float64 resolution; float64 length_x; float64 length_y;
    geometry_msgs/Pose pose
std_msgs/Header: builtin_interfaces/Time stamp; string frame_id
builtin_interfaces/Time: int32 sec; uint32 nanosec
geometry_msgs/Pose: Point position; Quaternion orientation
geometry_msgs/Point: float64 x; float64 y; float64 z
geometry_msgs/Quaternion: float64 x 0; float64 y 0; float64 z 0; float64 w 1
std_msgs/Float32MultiArray: MultiArrayLayout layout; float32[] data
std_msgs/MultiArrayLayout: MultiArrayDimension[] dim; uint32 data_offset
std_msgs/MultiArrayDimension: string label; uint32 size; uint32 stride
builtin_interfaces/Duration: int32 sec; uint32 nanosec
diagnostic_msgs/DiagnosticArray: std_msgs/Header header; DiagnosticStatus[] status
diagnostic_msgs/DiagnosticStatus: byte level; string name; string message; string hardware_id;
    KeyValue[] values
diagnostic_msgs/KeyValue: string key; string value
geometry_msgs/PoseStamped: std_msgs/Header header; Pose pose
geometry_msgs/PoseWithCovariance: Pose pose; float64[36] covariance
geometry_msgs/Transform: Vector3 translation; Quaternion rotation
geometry_msgs/TransformStamped: std_msgs/Header header; string child_frame_id;
    Transform transform
geometry_msgs/Twist: Vector3 linear; Vector3 angular
geometry_msgs/TwistWithCovariance: Twist twist; float64[36] covariance
geometry_msgs/Vector3: float64 x; float64 y; float64 z
nav_msgs/MapMetaData: builtin_interfaces/Time map_load_time; float32 resolution; uint32 width;
    uint32 height; geometry_msgs/Pose origin
nav_msgs/OccupancyGrid: std_msgs/Header header; MapMetaData info; int8[] data
nav_msgs/Odometry: std_msgs/Header header; string child_frame_id;
    geometry_msgs/PoseWithCovariance pose; geometry_msgs/TwistWithCovariance twist
nav_msgs/Path: std_msgs/Header header; geometry_msgs/PoseStamped[] poses
sensor_msgs/CompressedImage: std_msgs/Header header; string format; uint8[] data
sensor_msgs/PointCloud2: std_msgs/Header header; uint32 height; uint32 width;
    PointField[] fields; bool is_bigendian; uint32 point_step; uint32 row_step; uint8[] data;
    bool is_dense
sensor_msgs/PointField: string name; uint32 offset; uint8 datatype; uint32 count
std_msgs/ColorRGBA: float32 r; float32 g; float32 b; float32 a
tf2_msgs/TFMessage: geometry_msgs/TransformStamped[] transforms
visualization_msgs/Marker: std_msgs/Header header; string ns; int32 id; int32 type;
    int32 action; geometry_msgs/Pose pose; geometry_msgs/Vector3 scale;
    std_msgs/ColorRGBA color; builtin_interfaces/Duration lifetime; bool frame_locked;
    geometry_msgs/Point[] points; std_msgs/ColorRGBA[] colors; string texture_resource;
    sensor_msgs/CompressedImage texture; UVCoordinate[] uv_coordinates; string text;
    string mesh_resource; MeshFile mesh_file; bool mesh_use_embedded_materials
visualization_msgs/MarkerArray: Marker[] markers
visualization_msgs/MeshFile: string filename; uint8[] data
visualization_msgs/UVCoordinate: float32 u; float32 v
"""
"""Field definitions of `grid_map_msgs/GridMap`, its nested types, and types that viewers show."""

_LINES = {
    name: [line.strip() for line in text.split(";")]
    for name, text in re.findall(r"^(\w+/\w+):((?:.|\n )+)", _DEFINITIONS, re.MULTILINE)
}

DEFINITION = f"\n{'=' * 80}\n".join(
    "\n".join((*([] if name == GRID_MAP else [f"MSG: {name}"]), *lines, ""))
    for name, lines in islice(_LINES.items(), 10)
).rstrip("\n")
"""Definition of `grid_map_msgs/msg/GridMap` and all nested types, in the `ros2msg` format."""


def _fields(package: str, lines: Iterable[str]) -> Mapping[str, str]:
    """Return field types by name, like `get_fields_and_field_types` of a message class."""
    fields = {}
    for line in lines:
        kind, name, *_ = line.split()
        given, _, count = kind.rstrip("]").partition("[")
        item = _NUMBERS.get(given, given)
        if item[0].isupper():
            item = f"{package}/{item}"
        array = f"{item}[{count}]" if count else item
        fields[name] = f"sequence<{item}>" if kind.endswith("[]") else array
    return fields


_NUMBERS = {"bool": "boolean", "byte": "octet", "float32": "float", "float64": "double"}
"""Primitive types whose names in message definitions and in message classes differ."""

FIELDS_BY_TYPE = {name: _fields(name.partition("/")[0], lines) for name, lines in _LINES.items()}
"""Field types by field name, for each message type that needs no message package."""
