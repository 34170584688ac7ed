# SPDX-License-Identifier: BSD-3-Clause
"""Node `image_to_gridmap_demo`: converts images to elevation maps; bright pixels are high.

The node publishes `grid_map` with the layers `elevation` (the gray values) and `color`. All images
must have the size of the first image. Transparent pixels become cells without a value.
"""

import math

from sensor_msgs.msg import Image

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check
from grid_map_ros_py import (
    add_color_layer_from_image,
    add_layer_from_image,
    from_image,
    to_serialized_message,
)
from grid_map_ros_py.messages import from_stamp
from grid_map_ros_py.nodes._topics import LatchedSubscription

from .demo import Demo


class ImageToGridmapDemoNode(Demo):
    """Node that converts every image to a map."""

    def __init__(self) -> None:
        super().__init__("image_to_gridmap_demo")
        self._map: GridMap | None = None
        topic = self.read_topic("image_topic", "/image", "topic of the images")
        about = "side of a pixel on the ground [m]"
        self._resolution = self.read_positive("resolution", 0.03, about)
        low = self.read("min_height", 0.0, "height of black pixels [m]")
        high = self.read("max_height", 1.0, "height of white pixels [m]")
        check(math.isfinite(low), "min_height", "a finite number", low)
        other = math.isfinite(high) and high != low
        check(other, "max_height", f"a finite number other than min_height, {low}", high)
        self._heights = low, high
        about = "coordinate frame of the map; if empty, the frame of the image"
        self._frame_id = self.read("map_frame_id", "map", about)
        self._publisher = self.map_publisher()
        # Cameras usually publish with best effort.
        self._subscription = LatchedSubscription(
            self, Image, topic, self._receive, hears_best_effort=True
        )
        self.get_logger().info(f"makes maps from the images on {self._subscription.topic_name}")

    def _receive(self, message: Image) -> None:
        if self._map is None:
            self._map = from_image(message, "elevation", self._resolution, *self._heights)
            self._map.basic_layers = ["elevation"]
            self.get_logger().info(f"made {self._map}")
        else:
            add_layer_from_image(self._map, message, "elevation", *self._heights)
        add_color_layer_from_image(self._map, message, "color")
        self._map.frame_id = self._frame_id or message.header.frame_id
        self._map.timestamp = from_stamp(message.header.stamp)
        self._publisher.publish(to_serialized_message(self._map))


if __name__ == "__main__":
    raise SystemExit(ImageToGridmapDemoNode.main())
