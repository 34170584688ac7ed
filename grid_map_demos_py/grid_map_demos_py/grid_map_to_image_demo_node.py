# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_to_image_demo`: saves a layer of the next map as an image file and exits.

Pixel (row, column) is cell (row, column) in map order: +x is up and +y is to the left.
"""

import math
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from rclpy.utilities import try_shutdown

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import to_color_image, to_image
from grid_map_core_py.conversions._image_arrays import COLOR_LAYER, Image
from grid_map_core_py.errors import GridMapError, LimitError
from grid_map_core_py.files._image_files import encode_image, write_image
from grid_map_core_py.files._shared import storage_errors
from grid_map_core_py.plugins import check
from grid_map_ros_py import MessageError, ReceivedMap
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import MapSubscription

from .demo import Demo

DTYPES = {8: np.uint8, 16: np.uint16}


def keeps(file: Path, image: Image) -> bool:
    """Return whether a file format preserves the data type and channels of an image."""
    try:
        data = np.frombuffer(encode_image(image, file.suffix), np.uint8)
    except (cv2.error, ValueError):
        return False
    again = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    return again is not None and (again.dtype, again.shape) == (image.dtype, image.shape)


class GridMapToImageDemoNode(Demo):
    """Node that saves a layer of the first received map as an image."""

    def __init__(self) -> None:
        super().__init__("grid_map_to_image_demo")
        topic = self.read_topic("grid_map_topic", "/grid_map", "topic of the map")
        about = "image file in an existing folder; the extension selects the format"
        self._file = self.read_path("file", "~/.ros/grid_map.png", about)
        check(self._file.parent.is_dir(), "file", "a file in a folder that exists", str(self._file))
        self._layer = self.read("layer", "elevation", "layer to save")
        bits = self.read("bits", 8, "bits per channel, 8 or 16")
        check(bits in DTYPES, "bits", "8 or 16", bits)
        about = "the layer contains packed colors; the default for the layer `color` is true"
        is_color = self.read("is_color", self._layer == COLOR_LAYER, about)
        about = "cells without a value are transparent instead of black"
        is_transparent = self.read("use_transparency", False, about)
        low = self.read("lower", math.nan, "value that becomes black; if NaN, the smallest value")
        high = self.read("upper", math.nan, "value that becomes white; if NaN, the largest value")
        channels = 4 if is_transparent else 3 if is_color else 1
        if is_color:
            self._draw = partial(to_color_image, dtype=DTYPES[bits], channels=channels)
        else:
            lower, upper = (None if math.isnan(bound) else bound for bound in (low, high))
            self._draw = partial(
                to_image, dtype=DTYPES[bits], channels=channels, lower=lower, upper=upper
            )
        # Report an unusable file before the first map arrives.
        pixel = self._draw(GridMap((1.0, 1.0), 1.0, layers={self._layer: 0.0}), self._layer)
        expected = f"a format such as .png, that can hold {bits} bits"
        expected += " and transparency" * is_transparent
        check(keeps(self._file, pixel), "file", expected, str(self._file))
        self._subscription = MapSubscription(self, topic, self._receive)
        self.get_logger().info(
            f"saves {self._layer!r} of {self._subscription.topic_name} to {self._file}"
        )

    def _receive(self, received: ReceivedMap) -> None:
        try:
            image = self._draw(received.decode([self._layer]), self._layer)
            with storage_errors(self._file, "written"):
                write_image(self._file, image)
        except (LimitError, MessageError):
            raise
        except GridMapError as error:
            raise NodeFailedError(str(error)) from error
        self.get_logger().info(f"saved {image.shape[0]} x {image.shape[1]} pixels to {self._file}")
        try_shutdown()


if __name__ == "__main__":
    raise SystemExit(GridMapToImageDemoNode.main())
