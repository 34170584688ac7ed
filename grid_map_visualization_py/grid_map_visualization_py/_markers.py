# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""RViz markers that consist of lines."""

import math

import numpy as np
import numpy.typing as npt
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap, color_value_to_vector
from grid_map_core_py.plugins import check
from grid_map_ros_py.messages import serialize, to_header

from .colors import check_color


def check_line(color: int, line_width: float) -> None:
    """Raise `ConfigError` unless `color` is of the form 0xRRGGBB and `line_width` positive."""
    check_color(color)
    is_width = math.isfinite(line_width) and line_width > 0
    check(is_width, "line_width", "a positive width [m]", line_width)


def line_marker(
    grid_map: GridMap,
    points: npt.NDArray[np.float64],
    *,
    kind: int,
    namespace: str,
    color: int,
    line_width: float,
) -> bytes:
    """Return a serialized `visualization_msgs/Marker` that draws lines in the frame of the map.

    Args:
        points: (N, 3) x, y, z [m]. `kind` says which of them are connected.
        kind: `Marker.LINE_LIST` or `Marker.LINE_STRIP`.
        namespace: the marker's `ns`.
        color: 0xRRGGBB of every point, opaque.
        line_width: width of the lines [m].
    """
    marker = Marker(header=to_header(grid_map), ns=namespace, type=kind, action=Marker.ADD)
    marker.scale.x = line_width
    rgba = np.append(color_value_to_vector(color), np.float32(1))
    colors = np.tile(rgba, (len(points), 1))
    return serialize(marker, {"points": points, "colors": colors})
