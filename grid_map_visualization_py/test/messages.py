# SPDX-License-Identifier: BSD-3-Clause
"""Messages of visualizations as arrays, and those that the C++ nodes published."""

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rclpy.serialization import deserialize_message, serialize_message

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message
from grid_map_visualization_py import create

RECORDINGS = Path(__file__).parent / "data"


def drawn(type_name: str, grid_map: GridMap, **params: object) -> Any:
    """Return the message of a map as subscribers receive it."""
    visualization = create("a", {"type": type_name, "params": params})
    message = visualization(grid_map)
    data = message if isinstance(message, bytes) else serialize_message(message)
    return deserialize_message(data, visualization.message_type)


def points_of(message: Any) -> np.ndarray:
    """Return the points (N, 3) of a marker or of grid cells."""
    points = message.cells if hasattr(message, "cells") else message.points
    return np.array([(p.x, p.y, p.z) for p in points]).reshape(-1, 3)


def colors_of(marker: Any) -> np.ndarray:
    """Return red, green, blue, alpha (N, 4) of the points of a marker."""
    return np.array([(c.r, c.g, c.b, c.a) for c in marker.colors], np.float32).reshape(-1, 4)


def fields_of(cloud: Any, *names: str) -> np.ndarray:
    """Return fields (N, names) of a point cloud."""
    known = [field.name for field in cloud.fields]
    values = np.frombuffer(cloud.data, "<f4").reshape(cloud.width, -1)
    return values[:, [known.index(name) for name in names]]


def recorded_parameters(recording: str) -> dict[str, Any]:
    """Return the parameters of the node that was recorded."""
    content = yaml.safe_load((RECORDINGS / f"{recording}.yaml").read_text())
    return content["grid_map_visualization"]["ros__parameters"]


def recorded_bytes(name: str) -> bytes:
    """Return the message `<recording>/<topic>` in CDR."""
    return gzip.decompress((RECORDINGS / f"{name}.cdr.gz").read_bytes())


def recorded(name: str, message_type: type) -> Any:
    """Return the message `<recording>/<topic>`."""
    return deserialize_message(recorded_bytes(name), message_type)


def recorded_map(name: str) -> GridMap:
    """Return the map that was published on `<recording>/<topic>`."""
    return from_message(recorded(name, GridMapMessage), unwrap=False)
