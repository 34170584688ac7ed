# SPDX-License-Identifier: BSD-3-Clause
"""Conversions of polygons to and from `geometry_msgs/PolygonStamped`, and to RViz markers."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GeometryError, Polygon
from grid_map_core_py._arrays import as_array, as_number
from grid_map_core_py.errors import short

from ..errors import MessageError
from ._fields import check_fields, check_finite, from_stamp, to_stamp
from ._packages import messages_of

if TYPE_CHECKING:
    from geometry_msgs.msg import PolygonStamped
    from visualization_msgs.msg import Marker

WHITE = (1.0, 1.0, 1.0, 1.0)


# --- polygons -------------------------------------------------------------------------------------


def to_polygon(
    polygon: Polygon, *, frame_id: str = "", timestamp: int = 0, height: float = 0.0
) -> "PolygonStamped":
    """Convert a polygon to `geometry_msgs/PolygonStamped`; coordinates are rounded to float32.

    Args:
        polygon: the polygon [m].
        frame_id: frame of the vertices.
        timestamp: time of the message [ns].
        height: z of the vertices [m].
    """
    messages = messages_of("geometry_msgs")
    message: PolygonStamped = messages.PolygonStamped(header=_header(frame_id, timestamp))
    vertices = _raised(polygon.vertices, height)
    with np.errstate(over="ignore"):
        single = vertices.astype(np.float32)
    check_finite("polygon.points", single, "coordinates that float32 can hold", vertices)
    message.polygon.points = [messages.Point32(x=x, y=y, z=z) for x, y, z in single.tolist()]
    return message


def from_polygon(message: "PolygonStamped") -> Polygon:
    """Create a polygon from `geometry_msgs/PolygonStamped`; z is ignored."""
    check_fields(message, "geometry_msgs/PolygonStamped", "header", "polygon")
    from_stamp(message.header.stamp)
    pairs = [(point.x, point.y) for point in message.polygon.points]
    return Polygon(check_finite("polygon.points", np.array(pairs, np.float64).reshape(-1, 2)))


# --- markers --------------------------------------------------------------------------------------


def to_line_marker(
    polygon: Polygon,
    line_width: float,
    color: npt.ArrayLike = WHITE,
    *,
    frame_id: str = "",
    timestamp: int = 0,
    height: float = 0.0,
) -> "Marker":
    """Convert the outline of a polygon to a `visualization_msgs/Marker` with a closed line.

    Args:
        polygon: the polygon [m].
        line_width: width of the line [m].
        color: red, green, blue and alpha in [0, 1].
        frame_id, timestamp, height: as in `to_polygon`.
    """
    header, width = _header(frame_id, timestamp), as_number(line_width, "line_width")
    if not 0 <= width < math.inf:
        raise MessageError("line_width", "a finite number, 0 or more", width)
    closed = np.concatenate([polygon.vertices, polygon.vertices[:1]])
    marker = _marker(header, closed, height, color, len(closed))
    marker.type, marker.scale.x = marker.LINE_STRIP, width
    return marker


def to_triangle_list_marker(
    polygon: Polygon,
    color: npt.ArrayLike = WHITE,
    *,
    frame_id: str = "",
    timestamp: int = 0,
    height: float = 0.0,
) -> "Marker":
    """Convert the area of a polygon to a `visualization_msgs/Marker` with a triangle list.

    `Polygon.triangulate` creates the triangles. See `to_line_marker` for the arguments.
    """
    # Triangle fan as in `Polygon.triangulate`, without creating an object per triangle.
    count = max(len(polygon) - 2, 0)
    corners = np.arange(count)[:, None] + (0, 1, 2)
    corners[:, 0] = 0
    vertices = polygon.vertices[corners.ravel()]
    marker = _marker(_header(frame_id, timestamp), vertices, height, color, count)
    marker.type = marker.TRIANGLE_LIST
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    return marker


def _marker(
    header: Any, vertices: npt.NDArray[np.float64], height: float, color: npt.ArrayLike, count: int
) -> "Marker":
    rgba = as_array(color, np.float32, "color")
    if rgba.shape != (4,) or not ((rgba >= 0) & (rgba <= 1)).all():
        raise GeometryError(
            f"color: expected red, green, blue, alpha from 0 to 1, got {short(color)}"
        )
    r, g, b, a = rgba.tolist()
    point, color_type = messages_of("geometry_msgs").Point, messages_of("std_msgs").ColorRGBA
    marker: Marker = messages_of("visualization_msgs").Marker(header=header)
    marker.points = [point(x=x, y=y, z=z) for x, y, z in _raised(vertices, height).tolist()]
    marker.colors = [color_type(r=r, g=g, b=b, a=a) for _ in range(count)]
    return marker


def _raised(vertices: npt.NDArray[np.float64], height: float) -> npt.NDArray[np.float64]:
    if not math.isfinite(height := as_number(height, "height")):
        raise MessageError("height", "a finite number", height)
    return np.pad(vertices, ((0, 0), (0, 1)), constant_values=((0, 0), (0, height)))


def _header(frame_id: str, timestamp: int) -> Any:
    return messages_of("std_msgs").Header(frame_id=frame_id, stamp=to_stamp(timestamp))
