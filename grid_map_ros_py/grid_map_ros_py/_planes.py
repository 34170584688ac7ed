# SPDX-License-Identifier: BSD-3-Clause
"""Messages of planar regions: markers, polygons, and `PlanarTerrain` for controllers."""

import colorsys
from typing import TYPE_CHECKING, Any

import numpy as np
from geometry_msgs.msg import Point, Point32, Polygon, PolygonStamped
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from grid_map_core_py._arrays import Positions

from .messages import to_pose

if TYPE_CHECKING:
    from grid_map_core_py.planes import PlanarRegion, PlanarRegions

OPACITY = 0.6
"""Opacity of the filled regions."""

GOLDEN = 0.5 * (5**0.5 - 1)
"""Step of the hue from an id to the next, which keeps the hues of any few ids apart."""

CORNERS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
"""Row and column of the corners of a square, counter-clockwise in the map."""


def on_plane(region: "PlanarRegion", points: Positions) -> Positions:
    """Project x, y (..., 2) [m] vertically to points (..., 3) on the plane of a region."""
    normal, center = region.normal, region.center
    z = center[2] - (points - center[:2]) @ normal[:2] / normal[2]
    return np.concatenate([points, z[..., None]], axis=-1)


def plane_frame(region: "PlanarRegion") -> Positions:
    """Return the pose (4, 4) of a region's plane: origin at its center, z along the normal.

    The y axis is perpendicular to the map's x axis, as in `convex_plane_decomposition`.
    """
    y_axis = np.cross(region.normal, (1.0, 0.0, 0.0))
    y_axis /= np.linalg.norm(y_axis)
    matrix = np.eye(4)
    axes = np.cross(y_axis, region.normal), y_axis, region.normal, region.center
    matrix[:3] = np.stack(axes, axis=1)
    return matrix


def triangles(labels: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Divide the polygons of `PlanarRegions` into triangles between cell centers.

    A block of 2 x 2 cells is filled if all four cells have the same label, and half filled if three
    cells do. `labels` (rows, cols) are in map order; 0 means no region.

    Returns:
        corners: (T, 3, 2) row and column of the corners, counter-clockwise in the map.
        owners: (T,) label of each triangle.
    """
    rows, cols = np.maximum(np.subtract(labels.shape, 1), 0)
    block = np.stack([labels[r : r + rows, c : c + cols] for r, c in CORNERS])
    is_full = (block == block[0]).all(axis=0) & (block[0] > 0)
    full = np.pad(np.where(is_full, block[0], 0), ((0, 0), (1, 1)))
    begins, ends = (
        np.argwhere(is_full & (full[:, 1:-1] != other)) for other in (full[:, :-2], full[:, 2:])
    )
    sides = 1 + np.stack([0 * ends[:, 0], ends[:, 1] - begins[:, 1]], axis=1)
    boxes = begins[:, None] + CORNERS * sides[:, None]
    corners, owners = [boxes[:, :3], boxes[:, [0, 2, 3]]], [block[0][*begins.T]] * 2
    for missing in range(4):
        kept = np.delete(np.arange(4), missing)
        label = block[kept[0]]
        half = (block[kept] == label).all(axis=0) & ~is_full & (label > 0)
        corners.append(np.argwhere(half)[:, None] + CORNERS[kept])
        owners.append(label[half])
    return np.concatenate(corners), np.concatenate(owners)


def to_markers(regions: "PlanarRegions", header: Header) -> MarkerArray:
    """Return markers that draw the regions and their outlines, and replace all earlier markers.

    The namespaces are `regions` and `outlines`. Each marker has the id of its region.
    """
    corners, owners = triangles(regions.labels)
    x, y = regions.geometry.axes_in_map_order()
    points = np.stack([x[corners[..., 0]], y[corners[..., 1]]], axis=-1)
    order = np.argsort(owners, kind="stable")
    ends = np.cumsum(np.unique(owners, return_counts=True)[1])[:-1]
    # Every region has triangles, and regions are in the order of their ids. Without regions,
    # `split` returns one empty part.
    fills = np.split(points[order], ends)
    markers = [Marker(header=header, action=Marker.DELETEALL)]
    for region, filled in zip(regions, fills, strict=False):
        red, green, blue = colorsys.hsv_to_rgb(region.id * GOLDEN % 1.0, 0.8, 0.9)
        fill = Marker(header=header, ns="regions", id=region.id, type=Marker.TRIANGLE_LIST)
        fill.scale.x = fill.scale.y = fill.scale.z = 1.0
        fill.points = _points(on_plane(region, filled))
        fill.color = ColorRGBA(r=red, g=green, b=blue, a=OPACITY)
        line = Marker(header=header, ns="outlines", id=region.id, type=Marker.LINE_LIST)
        line.scale.x = 0.25 * regions.geometry.resolution
        loops = (region.outer, *region.holes)
        edges = [np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops]
        line.points = _points(on_plane(region, np.concatenate(edges)))
        line.color = ColorRGBA(r=0.6 * red, g=0.6 * green, b=0.6 * blue, a=1.0)
        markers += [fill, line]
    return MarkerArray(markers=markers)


def _points(points: Positions, kind: Any = Point) -> list[Any]:
    return [kind(x=x, y=y, z=z) for x, y, z in points.reshape(-1, 3).tolist()]


def to_polygons(regions: "PlanarRegions", header: Header) -> list[PolygonStamped]:
    """Return the outer polygon of each region, in the order of the ids."""
    polygons = (
        Polygon(points=_points(on_plane(region, region.outer), Point32)) for region in regions
    )
    return [PolygonStamped(header=header, polygon=polygon) for polygon in polygons]


def to_terrain(regions: "PlanarRegions", gridmap: Any, package: Any) -> Any:
    """Return a `PlanarTerrain` of `package`, the module `convex_plane_decomposition_msgs.msg`.

    Each polygon is in the frame of its plane. An inset is a polygon with a margin to the boundary
    of the planar ground. The regions already have such a margin, so the only inset of a region is
    its boundary.
    """

    def polygon(points: Positions) -> Any:
        return package.Polygon2d(points=[package.Point2d(x=x, y=y) for x, y in points.tolist()])

    terrain = package.PlanarTerrain(gridmap=gridmap)
    for region in regions:
        pose = plane_frame(region)
        loops = region.outer, *region.holes
        outer, *holes = ((on_plane(region, loop) - region.center) @ pose[:3, :2] for loop in loops)
        boundary = package.PolygonWithHoles2d(outer_boundary=polygon(outer))
        boundary.holes = [polygon(hole) for hole in holes]
        low, high = outer.min(axis=0).tolist(), outer.max(axis=0).tolist()
        box = package.BoundingBox2d(min_x=low[0], min_y=low[1], max_x=high[0], max_y=high[1])
        message = package.PlanarRegion(plane_parameters=to_pose(pose), bbox2d=box)
        message.boundary, message.insets = boundary, [boundary]
        terrain.planar_regions.append(message)
    return terrain
