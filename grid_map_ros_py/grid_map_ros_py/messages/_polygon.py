# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Polygons as `geometry_msgs/PolygonStamped` and as `visualization_msgs/Marker`.

Such messages hold one Python object per vertex. For large polygons the functions named
`to_serialized_...` make the bytes of the message at once; publishers accept them in its place.
"""

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GeometryError, Polygon
from grid_map_core_py.arrays import as_array, as_number

from ..errors import MessageError
from ._cdr import serialize
from ._packages import messages_of
from ._time import from_stamp, to_stamp

if TYPE_CHECKING:
    from geometry_msgs.msg import PolygonStamped
    from std_msgs.msg import Header
    from visualization_msgs.msg import Marker

Points = npt.NDArray[np.float64]
Colors = npt.NDArray[np.float32]

WHITE = (1.0, 1.0, 1.0, 1.0)


# --- polygons -------------------------------------------------------------------------------------


def to_polygon(
    polygon: Polygon, *, frame_id: str = "", timestamp: int = 0, height: float = 0.0
) -> "PolygonStamped":
    """Return a polygon as a message; its coordinates are float32.

    Args:
        polygon: the polygon [m].
        frame_id: frame of its vertices.
        timestamp: of the message [ns].
        height: z of the vertices [m].

    Raises:
        MessageError: the timestamp, the height or a vertex does not fit the message.
    """
    messages = messages_of("geometry_msgs")
    message = messages.PolygonStamped(header=_header(frame_id, timestamp))
    vertices = _single(_raised(polygon.vertices, height)).tolist()
    message.polygon.points = [messages.Point32(x=x, y=y, z=z) for x, y, z in vertices]
    return message


def to_serialized_polygon(
    polygon: Polygon, *, frame_id: str = "", timestamp: int = 0, height: float = 0.0
) -> bytes:
    """Return what `to_polygon` does, in CDR."""
    header = serialize(_header(frame_id, timestamp))
    points = _single(_raised(polygon.vertices, height))
    body = serialize(messages_of("geometry_msgs").Polygon(), {"points": points})
    # Nothing in the body is aligned to more than 4 bytes, as many as its encapsulation takes.
    return header + bytes(-len(header) % 4) + body[4:]


def from_polygon(message: "PolygonStamped") -> Polygon:
    """Return the polygon in a message, without its z.

    Raises:
        MessageError: a vertex is not finite.
    """
    from_stamp(message.header.stamp)
    pairs = [(point.x, point.y) for point in message.polygon.points]
    finite = np.isfinite(np.array(pairs).reshape(-1, 2)).all(axis=1)
    if not finite.all():
        index = int(np.argmin(finite))
        raise MessageError(f"polygon.points[{index}]", "finite coordinates", pairs[index])
    return Polygon(pairs)


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
    """Return the outline of a polygon as a marker, a closed line.

    Args:
        polygon: the polygon [m].
        line_width: width of the line [m].
        color: red, green, blue and alpha from 0 to 1.
        frame_id: frame of the vertices.
        timestamp: of the message [ns].
        height: z of the vertices [m].

    Raises:
        MessageError: the timestamp does not fit the message, or the height or the width of the line
            makes no sense.
        GeometryError: the colour does not have four components from 0 to 1.
    """
    return _with_points(*_line(polygon, line_width, color, _header(frame_id, timestamp), height))


def to_serialized_line_marker(
    polygon: Polygon,
    line_width: float,
    color: npt.ArrayLike = WHITE,
    *,
    frame_id: str = "",
    timestamp: int = 0,
    height: float = 0.0,
) -> bytes:
    """Return what `to_line_marker` does, in CDR."""
    return _serialized(*_line(polygon, line_width, color, _header(frame_id, timestamp), height))


def to_triangle_list_marker(
    polygon: Polygon,
    color: npt.ArrayLike = WHITE,
    *,
    frame_id: str = "",
    timestamp: int = 0,
    height: float = 0.0,
) -> "Marker":
    """Return the area of a polygon as a marker of triangles, as `Polygon.triangulate` cuts it.

    Args and errors are those of `to_line_marker`. There is one colour per triangle.
    """
    return _with_points(*_triangles(polygon, color, _header(frame_id, timestamp), height))


def to_serialized_triangle_list_marker(
    polygon: Polygon,
    color: npt.ArrayLike = WHITE,
    *,
    frame_id: str = "",
    timestamp: int = 0,
    height: float = 0.0,
) -> bytes:
    """Return what `to_triangle_list_marker` does, in CDR."""
    return _serialized(*_triangles(polygon, color, _header(frame_id, timestamp), height))


def _line(
    polygon: Polygon, line_width: float, color: npt.ArrayLike, header: "Header", height: float
) -> "tuple[Marker, Points, Colors]":
    marker = messages_of("visualization_msgs").Marker(header=header)
    marker.type = marker.LINE_STRIP
    marker.scale.x = as_number(line_width, "line_width")
    if not 0 <= marker.scale.x < math.inf:
        raise MessageError("line_width", "a finite number, 0 or more", marker.scale.x)
    closed = np.concatenate([polygon.vertices, polygon.vertices[:1]])
    return marker, _raised(closed, height), _repeated(color, len(closed))


def _triangles(
    polygon: Polygon, color: npt.ArrayLike, header: "Header", height: float
) -> "tuple[Marker, Points, Colors]":
    marker = messages_of("visualization_msgs").Marker(header=header)
    marker.type = marker.TRIANGLE_LIST
    marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    # The fan of `Polygon.triangulate`, without an object for every triangle.
    count = max(len(polygon) - 2, 0)
    corners = np.arange(count)[:, None] + (0, 1, 2)
    corners[:, 0] = 0
    return marker, _raised(polygon.vertices[corners.ravel()], height), _repeated(color, count)


def _with_points(marker: "Marker", points: Points, colors: Colors) -> "Marker":
    point, color = messages_of("geometry_msgs").Point, messages_of("std_msgs").ColorRGBA
    marker.points = [point(x=x, y=y, z=z) for x, y, z in points.tolist()]
    marker.colors = [color(r=r, g=g, b=b, a=a) for r, g, b, a in colors.tolist()]
    return marker


def _serialized(marker: "Marker", points: Points, colors: Colors) -> bytes:
    return serialize(marker, {"points": points, "colors": colors})


def _raised(vertices: Points, height: float) -> Points:
    if not math.isfinite(height := as_number(height, "height")):
        raise MessageError("height", "a finite number", height)
    return np.pad(vertices, ((0, 0), (0, 1)), constant_values=((0, 0), (0, height)))


def _single(points: Points) -> npt.NDArray[np.float32]:
    """Return (N, 3) points as float32, which they must fit."""
    with np.errstate(over="ignore"):
        single = points.astype(np.float32)
    finite = np.isfinite(single).all(axis=1)
    if not finite.all():
        index = int(np.argmin(finite))
        found = tuple(points[index].tolist())
        raise MessageError(f"polygon.points[{index}]", "coordinates that float32 can hold", found)
    return single


def _repeated(color: npt.ArrayLike, count: int) -> Colors:
    rgba = as_array(color, np.float32, "color")
    if rgba.shape != (4,) or not ((rgba >= 0) & (rgba <= 1)).all():
        raise GeometryError(f"color: expected red, green, blue, alpha from 0 to 1, got {color!r}")
    return np.tile(rgba, (count, 1))


def _header(frame_id: str, timestamp: int) -> "Header":
    return messages_of("std_msgs").Header(stamp=to_stamp(timestamp), frame_id=frame_id)
