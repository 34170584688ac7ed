# SPDX-License-Identifier: BSD-3-Clause
"""Convert ROS messages to Rerun archetypes."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from grid_map_ros_py import MessageError, from_pose, from_stamp, read_points
from grid_map_ros_py.messages import from_transform

from .._marker_shapes import of_points, orientation_of, points_of, pose_of, rgba_of

Origin: TypeAlias = npt.NDArray[np.float64]

PATH_COLOR = (255, 0, 200)


@dataclass(frozen=True)
class Placed:
    """Part of a message as Rerun archetypes, with its entity path, frame and time.

    Attributes:
        time: time in the message header [ns]; 0 if there is none.
        path: parts of the entity path below the topic, or from the root if `is_global`.
        frame: ROS frame; None if the archetypes are not drawn in a frame.
        archetypes: function that returns the archetypes for an origin (3,) in `frame` [m].
            Positions are relative to the origin. Invalid messages raise `MessageError`.
        kept: None to log the archetypes. Otherwise, all earlier paths below the topic are cleared,
            except those in `kept`.
    """

    time: int
    path: tuple[str, ...]
    frame: str | None
    archetypes: Callable[[Origin], list[Any]]
    is_global: bool = False
    kept: frozenset[tuple[str, ...]] | None = None


class Shape(IntEnum):
    ARROW = 0
    CUBE = 1
    SPHERE = 2
    CYLINDER = 3
    LINE_STRIP = 4
    LINE_LIST = 5
    CUBE_LIST = 6
    SPHERE_LIST = 7
    POINTS = 8
    TEXT_VIEW_FACING = 9
    TRIANGLE_LIST = 11


def _always(archetype: Any) -> Callable[[Origin], list[Any]]:
    return lambda _: [archetype]


def _transforms(rr: Any, message: Any, _: int) -> Iterator[Placed]:
    for one in message.transforms:

        def moved(_: Origin, one: Any = one) -> list[Any]:
            matrix = from_transform(one.transform)
            frames = {"parent_frame": one.header.frame_id, "child_frame": one.child_frame_id}
            return [rr.Transform3D(translation=matrix[:3, 3], mat3x3=matrix[:3, :3], **frames)]

        yield Placed(from_stamp(one.header.stamp), ("tf", one.child_frame_id), None, moved, True)


def _pose(rr: Any, message: Any, _: int) -> Iterator[Placed]:
    matrix = from_pose(message)

    def arrows(origin: Origin) -> list[Any]:
        colors = [(220, 40, 40), (40, 180, 40), (60, 80, 230)]
        start = matrix[:3, 3] - origin
        return [rr.Arrows3D(origins=[start] * 3, vectors=matrix[:3, :3].T, colors=colors)]

    def point(origin: Origin) -> list[Any]:
        return [rr.Points3D([matrix[:3, 3] - origin], radii=rr.Radius.ui_points(2.0))]

    yield Placed(from_stamp(message.header.stamp), ("pose",), message.header.frame_id, arrows)
    yield Placed(from_stamp(message.header.stamp), ("trail",), message.header.frame_id, point)


def _path(rr: Any, message: Any, _: int) -> Iterator[Placed]:
    points = np.array(
        [(p.x, p.y, p.z) for p in (one.pose.position for one in message.poses)], float
    ).reshape(-1, 3)

    def strip(origin: Origin) -> list[Any]:
        look = {"radii": rr.Radius.ui_points(2.5), "colors": [PATH_COLOR]}
        return [rr.LineStrips3D([points - origin], **look)]

    yield Placed(from_stamp(message.header.stamp), (), message.header.frame_id, strip)


def _cloud(rr: Any, message: Any, most: int) -> Iterator[Placed]:
    fields = read_points(message)
    if missing := [axis for axis in "xyz" if axis not in fields]:
        raise MessageError("fields", "x, y and z", f"none named {missing[0]}")
    points = np.stack([fields[axis] for axis in "xyz"], axis=-1)
    shown = np.flatnonzero(np.isfinite(points).all(axis=-1))
    shown = shown[:: -(-len(shown) // most) if most and len(shown) else 1]
    colors = None
    if "rgb" in fields and fields["rgb"].itemsize == 4:
        packed = np.ascontiguousarray(fields["rgb"][shown]).view(np.uint32)
        colors = np.stack([packed >> shift & 255 for shift in (16, 8, 0)], axis=-1)

    def cloud(origin: Origin) -> list[Any]:
        radii = rr.Radius.ui_points(1.5)
        return [rr.Points3D(points[shown] - origin, radii=radii, colors=colors)]

    yield Placed(from_stamp(message.header.stamp), (), message.header.frame_id, cloud)


def _occupancy_grid(rr: Any, message: Any, _: int) -> Iterator[Placed]:
    info, matrix = message.info, from_pose(message.info.origin)
    form = rr.components.ImageFormat(
        width=info.width, height=info.height, color_model="L", channel_datatype="U8"
    )
    cells = np.asarray(message.data, np.int8)
    if len(cells) != info.height * info.width:
        raise MessageError("data", f"{info.width} x {info.height} cells", len(cells))
    # The first row of an image is the top row.
    cells = cells.reshape(info.height, info.width)[::-1]

    def grid(origin: Origin) -> list[Any]:
        q = info.origin.orientation
        archetype = rr.GridMap(
            data=cells.tobytes(),
            format=form,
            cell_size=info.resolution,
            translation=matrix[:3, 3] - origin,
            quaternion=[q.x, q.y, q.z, q.w],
            colormap=rr.components.Colormap.RvizMap,
        )
        return [archetype]

    yield Placed(from_stamp(message.header.stamp), (), message.header.frame_id, grid)


def _markers(rr: Any, message: Any, _: int) -> Iterator[Placed]:
    markers = message.markers if hasattr(message, "markers") else [message]
    paths = [(marker.ns or "markers", str(marker.id)) for marker in markers]
    for index, (marker, path) in enumerate(zip(markers, paths, strict=True)):
        time = from_stamp(marker.header.stamp)
        if marker.action == 0:
            yield Placed(time, path, marker.header.frame_id, partial(_marker, rr, marker))
        elif marker.action == 2:
            yield Placed(time, path, None, _always(rr.Clear(recursive=True)))
        else:
            # In Rerun, a deletion would also hide markers that follow at the same time.
            yield Placed(time, (), None, lambda _: [], kept=frozenset(paths[index + 1 :]))


def _marker(rr: Any, marker: Any, origin: Origin) -> list[Any]:
    matrix, q = pose_of(marker), orientation_of(marker)
    center = matrix[:3, 3] - origin
    points = points_of(marker, matrix) - origin
    scale = np.array([marker.scale.x, marker.scale.y, marker.scale.z])
    rgba = rgba_of(marker)
    start, vector = center, matrix[:3, 0] * scale[0]
    if len(points) == 2:
        start, vector = points[0], points[1] - points[0]
    wide = {"radii": scale[0] / 2}
    solid = {"colors": rgba, "fill_mode": "solid"}
    posed = {
        "centers": [center],
        "quaternions": [rr.Quaternion(xyzw=[q.x, q.y, q.z, q.w])],
        **solid,
    }
    # Triangle lists have one color, one color per triangle, or one color per corner.
    of_corners = of_points(rgba, len(points))
    pairs = points[: len(points) // 2 * 2].reshape(-1, 2, 3)
    halves = np.tile(scale / 2, (len(points), 1))
    shapes: dict[int, Callable[[], Any]] = {
        Shape.ARROW: lambda: rr.Arrows3D(origins=[start], vectors=[vector], colors=rgba),
        Shape.CUBE: lambda: rr.Boxes3D(half_sizes=[scale / 2], **posed),
        Shape.SPHERE: lambda: rr.Ellipsoids3D(half_sizes=[scale / 2], **posed),
        # Cylinders in Rerun have a circular cross-section.
        Shape.CYLINDER: lambda: rr.Cylinders3D(
            lengths=scale[2], radii=scale[:2].mean() / 2, **posed
        ),
        Shape.LINE_STRIP: lambda: rr.LineStrips3D([points], colors=rgba[:1], **wide),
        Shape.LINE_LIST: lambda: rr.LineStrips3D(pairs, colors=rgba[::2], **wide),
        Shape.CUBE_LIST: lambda: rr.Boxes3D(centers=points, half_sizes=halves, **solid),
        Shape.SPHERE_LIST: lambda: rr.Points3D(points, colors=rgba, **wide),
        Shape.POINTS: lambda: rr.Points3D(points, colors=rgba, **wide),
        Shape.TEXT_VIEW_FACING: lambda: rr.Points3D(
            [center], labels=[marker.text], show_labels=True, colors=rgba
        ),
        Shape.TRIANGLE_LIST: lambda: rr.Mesh3D(vertex_positions=points, vertex_colors=of_corners),
    }
    return [shapes[marker.type]() if marker.type in shapes else rr.Clear(recursive=False)]


def _diagnostics(rr: Any, message: Any, _: int) -> Iterator[Placed]:
    for status in message.status:
        for entry in status.values:
            # Plot the latest durations ("ms", "ms FILTER"); their means ("mean ms") are redundant.
            unit, _, part = entry.key.partition(" ")
            if unit != "ms":
                continue
            try:
                scalar = rr.Scalars(float(entry.value))
            except ValueError:
                continue
            path = ("milliseconds", status.name, part or "all")
            yield Placed(
                from_stamp(message.header.stamp), path, None, _always(scalar), is_global=True
            )


SHOWN: dict[str, Callable[[Any, Any, int], Iterator[Placed]]] = {
    "diagnostic_msgs/msg/DiagnosticArray": _diagnostics,
    "geometry_msgs/msg/PoseStamped": _pose,
    "nav_msgs/msg/OccupancyGrid": _occupancy_grid,
    "nav_msgs/msg/Odometry": _pose,
    "nav_msgs/msg/Path": _path,
    "sensor_msgs/msg/PointCloud2": _cloud,
    "tf2_msgs/msg/TFMessage": _transforms,
    "visualization_msgs/msg/Marker": _markers,
    "visualization_msgs/msg/MarkerArray": _markers,
}
"""Functions that convert a message to `Placed` items. The keys are the supported message types."""

POSES = frozenset(kind for kind, function in SHOWN.items() if function is _pose)
"""Message types with a single pose, which are shown with a trail."""
