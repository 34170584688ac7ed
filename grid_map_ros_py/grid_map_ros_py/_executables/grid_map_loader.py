# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_loader`: publishes the last map of a bag on a latched topic."""

from rclpy.duration import Duration

from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import load_from_bag, to_serialized_message
from ..nodes import ConfiguredNode, map_qos, read_parameter


class GridMapLoaderNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__("grid_map_loader")
        about = "folder or file of the bag"
        path = read_parameter(self, "file_path", str, description=about)
        about = "topic in the bag; empty means the only topic with maps"
        bag_topic = self.read("bag_topic", "/grid_map", about)
        topic = self.read_topic("publish_topic", "/grid_map", "topic of the map")
        about = "time after which new subscribers no longer receive the map [s]; 0 means no limit"
        duration = self.read_number("duration", 0.0, 0.0, 1e9, about)
        qos = map_qos()
        if duration:
            qos.lifespan = Duration(nanoseconds=round(duration * 1e9))
        grid_map = load_from_bag(path, bag_topic or None, unwrap=False)
        self._publisher = self.create_publisher(GridMapMessage, topic, qos)
        name = self._publisher.topic_name
        self._publisher.publish(to_serialized_message(grid_map))
        self.get_logger().info(f"publishes {grid_map} from {path} on {name}")


if __name__ == "__main__":
    raise SystemExit(GridMapLoaderNode.main())
