# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_sdf_demo`: publishes the signed distance field of a map as point clouds.

The field extends from just below the lowest cell of the map to just above the highest cell. Cells
without a height get the lowest height of the map.
"""

import array

import numpy as np
import numpy.typing as npt
from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridMap, SignedDistanceField
from grid_map_core_py.errors import GridMapError
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.messages._fields import to_header
from grid_map_ros_py.messages._point_cloud import write_points
from grid_map_ros_py.nodes import MapSubscription, map_qos

from .demo import Demo

FIELDS = ("x", "y", "z", "intensity")
MARGIN = 0.1  # distance by which the field extends below the lowest and above the highest cell [m]

MOST_LEVELS = 10_000
MOST_NODES = 20_000_000
"""Maximum number of points; larger fields would take minutes, and gigabytes of memory."""

Points = npt.NDArray[np.float32]


def distance_field(grid_map: GridMap, layer: str) -> SignedDistanceField:
    """Return the signed distance field of a height layer; raise an error if it is too large."""
    heights = grid_map[layer]
    known = np.isfinite(heights)
    if not known.any():
        raise GridMapError(f"layer {layer!r}: expected heights, got no finite value")
    lowest, highest = float(heights[known].min()), float(heights[known].max())
    levels = (highest - lowest + 2.0 * MARGIN) / grid_map.resolution
    if levels > MOST_LEVELS or levels * heights.size > MOST_NODES:
        raise GridMapError(
            f"layer {layer!r}: expected a field of at most {MOST_LEVELS} levels and {MOST_NODES} "
            f"nodes, got {levels:.0f} levels of {heights.size} nodes"
        )
    filled = grid_map.with_layers({layer: np.where(known, heights, np.float32(lowest))})
    return SignedDistanceField(filled, layer, lowest - MARGIN, highest + MARGIN)


def to_point_cloud(points: Points, grid_map: GridMap) -> PointCloud2:
    """Convert points (N, 4) with the columns `FIELDS` to a message with the map's header."""
    data = array.array("B", points.astype("<f4", copy=False).tobytes())
    message = write_points(FIELDS, data, to_header(grid_map))
    message.is_dense = True
    return message


class SdfDemoNode(Demo):
    """Node that converts every map to three point clouds."""

    def __init__(self) -> None:
        super().__init__("grid_map_sdf_demo")
        self._layer = self.read("elevation_layer", "elevation", "height layer")
        about = "prefix of the topics full_sdf, free_space and occupied_space"
        default = "/grid_map_sdf_demo/signed_distance_field"
        clouds = self.read_topic("pointcloud_topic", default, about)
        maps = self.read_topic("grid_map_topic", "/grid_map", "topic of grid maps")
        self._full, self._free, self._occupied = (
            self.create_publisher(PointCloud2, f"{clouds}/{name}", map_qos())
            for name in ("full_sdf", "free_space", "occupied_space")
        )
        self._subscription = MapSubscription(self, maps, self._receive)
        self.get_logger().info(
            f"makes distance fields from {self._layer!r} of {self._subscription.topic_name}"
        )

    def _receive(self, received: ReceivedMap) -> None:
        grid_map = received.decode([self._layer])
        points = distance_field(grid_map, self._layer).to_points()
        is_free = points[:, 3] > 0.0
        self._full.publish(to_point_cloud(points, grid_map))
        self._free.publish(to_point_cloud(points[is_free], grid_map))
        self._occupied.publish(to_point_cloud(points[~is_free], grid_map))


if __name__ == "__main__":
    raise SystemExit(SdfDemoNode.main())
