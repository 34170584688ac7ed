# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_simple_demo`: publishes a moving wave on `grid_map`, 30 times a second."""

import numpy as np

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_serialized_message
from grid_map_ros_py.nodes import ConfiguredNode, map_qos


class SimpleDemoNode(ConfiguredNode):
    """Node that fills a map with a moving wave and publishes it."""

    def __init__(self) -> None:
        super().__init__("grid_map_simple_demo")
        self._map = GridMap((1.2, 2.01), 0.03, layers=["elevation"], frame_id="map")
        self._publisher = self.create_publisher(GridMapMessage, "grid_map", map_qos())
        self.get_logger().info(f"publishes {self._map} on {self._publisher.topic_name}")
        self.create_timer(1.0 / 30.0, self._publish)

    def _publish(self) -> None:
        now = self.get_clock().now().nanoseconds
        x, y = self._map.axes()
        wave = np.sin(3.0 * 1e-9 * now + 5.0 * y)
        self._map["elevation"] = -0.04 + 0.2 * wave[None, :] * x[:, None]
        self._map.timestamp = now
        self._publisher.publish(to_serialized_message(self._map))


if __name__ == "__main__":
    raise SystemExit(SimpleDemoNode.main())
