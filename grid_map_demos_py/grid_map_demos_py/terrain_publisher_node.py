# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_terrain`: publishes a real terrain with holes at a fixed rate."""

from rclpy.node import Node

from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_serialized_message
from grid_map_ros_py.nodes import map_qos, read_parameter, read_positive, read_topic, run

from .share import share, user_path
from .terrain import load_terrain


class TerrainPublisherNode(Node):
    """Publishes the same terrain with the current time."""

    def __init__(self) -> None:
        super().__init__("grid_map_terrain")
        topic = read_topic(self, "topic", "/grid_map", description="topic of the map")
        about = "elevation model, an .npz file; empty for the one in this package"
        file = read_parameter(self, "file", str, "", description=about)
        path = user_path(file) if file else share("data", "jacksboro_fault_dem.npz")
        resolution = read_positive(self, "resolution", 0.03, description="side of a cell [m]")
        about = "coordinate frame of the map"
        frame_id = read_parameter(self, "frame_id", str, "map", description=about)
        self._map = load_terrain(path, resolution, frame_id=frame_id)
        rate = read_positive(self, "publish_rate", 1.0, description="maps per second [Hz]")
        self._publisher = self.create_publisher(GridMapMessage, topic, map_qos())
        self.create_timer(1.0 / rate, self._publish)
        self._publish()

    def _publish(self) -> None:
        self._map.timestamp = self.get_clock().now().nanoseconds
        self._publisher.publish(to_serialized_message(self._map))


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(TerrainPublisherNode)


if __name__ == "__main__":
    raise SystemExit(main())
