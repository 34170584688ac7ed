# SPDX-License-Identifier: BSD-3-Clause
"""Points and colors of `visualization_msgs/Marker`, for the web viewer and the Rerun viewer."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Positions
from grid_map_ros_py import from_pose


def orientation_of(marker: Any) -> Any:
    """Return the quaternion of a marker; as in RViz, all zeros mean no rotation."""
    q = marker.pose.orientation
    return q if any((q.x, q.y, q.z, q.w)) else SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)


def pose_of(marker: Any) -> Positions:
    """Return the pose (4, 4) of a marker."""
    place = {"position": marker.pose.position, "orientation": orientation_of(marker)}
    return from_pose(SimpleNamespace(**place))


def points_of(marker: Any, pose: Positions) -> Positions:
    """Return the points (N, 3) [m] of a marker in the frame of the marker header."""
    points = np.array([(p.x, p.y, p.z) for p in marker.points], float).reshape(-1, 3)
    with np.errstate(invalid="ignore"):
        return points @ pose[:3, :3].T + pose[:3, 3]


def rgba_of(marker: Any) -> npt.NDArray[np.uint8]:
    """Return `colors` as RGBA values (N, 4); if `colors` is empty, return `color` (1, 4)."""
    colors = np.array([(c.r, c.g, c.b, c.a) for c in marker.colors or [marker.color]])
    rgba: npt.NDArray[np.uint8] = np.rint(255 * np.clip(colors, 0, 1)).astype(np.uint8)
    return rgba


def of_points(rgba: npt.NDArray[np.uint8], count: int) -> npt.NDArray[np.uint8]:
    """Expand one color, or one color per triangle, to one color for each of `count` points."""
    return np.repeat(rgba, -(-count // len(rgba)), axis=0)[:count]
