# SPDX-License-Identifier: BSD-3-Clause
"""Node `image_publisher`: publishes an image file at a fixed rate.

The node reads the file again for each message. The image may be gray or in color, with or without
an alpha channel. Pixel values are 8-bit or 16-bit integers or floats.
"""

from pathlib import Path

import numpy as np
from sensor_msgs.msg import Image

from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files._image_files import read_image
from grid_map_core_py.files._shared import storage_errors
from grid_map_ros_py.messages._image import ENCODINGS, from_pixels
from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.nodes._health import LogThrottle

from .demo import Demo

NAMES = (
    *("mono8", "bgr8", "bgra8", "mono16", "bgr16", "bgra16"),
    *("32FC1", "32FC3", "32FC4", "64FC1", "64FC3", "64FC4"),
)
ENCODING_OF = {(ENCODINGS[name].dtype, ENCODINGS[name].channels): name for name in NAMES}
"""ROS encodings by data type and number of channels; colors are in BGR order, as in OpenCV."""


def read_message(path: Path) -> Image:
    """Read an image file into a message with an empty header."""
    with storage_errors(path, "read"):
        pixels = np.atleast_3d(read_image(path))
        if (pixels.dtype, pixels.shape[2]) not in ENCODING_OF:
            raise ValueError(
                f"expected 1, 3 or 4 channels of 8 or 16 bits or floats, got {pixels.shape[2]} "
                f"of {pixels.dtype}"
            )
    return from_pixels(pixels, ENCODING_OF[pixels.dtype, pixels.shape[2]], Image().header)


class ImagePublisherNode(Demo):
    """Node that publishes an image file."""

    def __init__(self) -> None:
        super().__init__("image_publisher")
        self._log = LogThrottle(self.get_logger())
        about = "image file; if empty, the demo terrain"
        self._path = self.read_path("image_path", "", about, data="terrain.png")
        topic = self.read_topic("topic", "image", "topic of the image")
        self._frame_id = self.read("frame_id", "map", "coordinate frame of the image")
        rate = self.read_positive("publish_rate", 0.5, "images per second [Hz]")
        self._publisher = self.create_publisher(Image, topic, map_qos())
        self._publish()
        self.create_timer(1.0 / rate, self._publish_again)
        self.get_logger().info(f"publishes {self._path} on {self._publisher.topic_name}")

    def _publish_again(self) -> None:
        try:
            self._publish()
        except GridMapError as error:
            # Another program may be writing the file.
            self._log.warning(str(error))

    def _publish(self) -> None:
        message = read_message(self._path)
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id = self._frame_id
        self._publisher.publish(message)


if __name__ == "__main__":
    raise SystemExit(ImagePublisherNode.main())
