# SPDX-License-Identifier: BSD-3-Clause
"""Lines and triangles of the markers that `web_viewer` draws."""

from typing import Any

import numpy as np

from grid_map_ros_py import MessageError
from grid_map_ros_py.messages._fields import check_finite

from .._marker_shapes import of_points, points_of, pose_of, rgba_of
from .scene import EMPTY, Drawing

DELETE, DELETE_ALL = 2, 3
STRIP, LINES, TRIANGLES = 4, 5, 11
CORNERS = {STRIP: 2, LINES: 2, TRIANGLES: 3}
"""Corners of the pieces of line strips, line lists and triangle lists, by marker type."""


class Markers:
    """Markers of one topic that are visible after all messages received so far."""

    def __init__(self) -> None:
        self._drawn: dict[tuple[str, int], tuple[str, Drawing]] = {}

    @property
    def frames(self) -> set[str]:
        return {frame for frame, _ in self._drawn.values()}

    def receive(self, message: Any) -> None:
        """Apply a `visualization_msgs/MarkerArray`; if a marker is invalid, change no marker."""
        drawn = dict(self._drawn)
        for index, marker in enumerate(message.markers):
            key = marker.ns, marker.id
            if marker.action == DELETE_ALL:
                drawn.clear()
            elif marker.action == DELETE:
                drawn.pop(key, None)
            elif marker.type in CORNERS:
                drawn[key] = marker.header.frame_id, _drawing(marker, index)
            else:
                shapes = "4 (line strip), 5 (line list) or 11 (triangle list)"
                raise MessageError(f"markers[{index}].type", shapes, marker.type)
        self._drawn = drawn

    def drawing(self, frame_id: str) -> Drawing:
        """Return the lines and triangles in a frame, with the lowest opacity of the triangles."""
        parts = [EMPTY, *(part for frame, part in self._drawn.values() if frame == frame_id)]
        *arrays, opacities = zip(*parts, strict=True)
        lines, line_colors, triangles, colors = map(np.concatenate, arrays)
        return Drawing(lines, line_colors, triangles, colors, min(opacities))


def _drawing(marker: Any, index: int) -> Drawing:
    points, rgba, count = points_of(marker, pose_of(marker)), rgba_of(marker), CORNERS[marker.type]
    check_finite(f"markers[{index}].points", points)
    if len(rgba) not in {1, len(points)} | ({len(points) // 3} if count == 3 else set()):
        expected = f"no color, or one for each of {len(points)} points"
        raise MessageError(f"markers[{index}].colors", expected, len(rgba))
    pieces = np.arange(len(points) // count * count).reshape(-1, count)
    if marker.type == STRIP:
        pieces = np.arange(max(len(points) - 1, 0))[:, None] + (0, 1)
    colors = of_points(rgba, len(points))
    shape, paint = points[pieces], colors[pieces][..., :3]
    if count == 2:
        return EMPTY._replace(lines=shape, line_colors=paint)
    opacity = float(colors[:, 3].min(initial=255)) / 255
    return EMPTY._replace(triangles=shape, triangle_colors=paint, opacity=opacity)
