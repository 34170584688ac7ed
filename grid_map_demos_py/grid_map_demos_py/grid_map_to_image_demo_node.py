# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_to_image_demo`: saves a layer of the next map as an image file and ends.

Pixel (row, column) is cell (row, column) in map order, with +x up and +y to the left. The file
is written atomically.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from rclpy.utilities import try_shutdown

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import COLOR_LAYER, Image, to_color_image, to_image
from grid_map_core_py.errors import GridMapError
from grid_map_core_py.files import new_file, storage_errors
from grid_map_core_py.plugins import check
from grid_map_ros_py import MessageError, ReceivedMap
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import MapSubscription

from .demo import Demo

DTYPES = {8: np.uint8, 16: np.uint16}


@dataclass(frozen=True, kw_only=True)
class Picture:
    """Conversion of a layer to an image.

    Attributes:
        layer: name of the layer.
        bits: 8 or 16 per channel.
        is_color: the layer holds packed colors; otherwise the image is gray.
        is_transparent: the image has an alpha channel, 0 where cells have no value.
        lower, upper: values of black and white; None for the smallest and the largest.
    """

    layer: str
    bits: int = 8
    is_color: bool = False
    is_transparent: bool = False
    lower: float | None = None
    upper: float | None = None

    def draw(self, grid_map: GridMap) -> Image:
        """Return the image; its colors are BGR, as OpenCV writes them."""
        dtype = DTYPES[self.bits]
        if self.is_color:
            return to_color_image(grid_map, self.layer, dtype, 4 if self.is_transparent else 3)
        channels = 4 if self.is_transparent else 1
        return to_image(grid_map, self.layer, dtype, channels, self.lower, self.upper)

    def fits(self, file: Path) -> bool:
        """Return True if the format of a file (by its ending) stores such images without loss."""
        pixel = self.draw(GridMap((1.0, 1.0), 1.0, layers={self.layer: 0.0}))
        if not cv2.haveImageWriter(str(file)):
            return False
        try:
            data = np.frombuffer(encode(pixel, file), np.uint8)
        except GridMapError:
            return False
        again = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
        return again is not None and (again.dtype, again.shape) == (pixel.dtype, pixel.shape)


def encode(image: Image, file: Path) -> bytes:
    """Return the bytes of an image file; the ending of its name sets the format.

    Raises:
        GridMapError: OpenCV does not write such images in this format.
    """
    try:
        is_done, data = cv2.imencode(file.suffix, image)
    except cv2.error:
        is_done = False
    if not is_done:
        raise GridMapError(f"{file}: OpenCV cannot write this image in this format")
    return data.tobytes()


class GridMapToImageDemoNode(Demo):
    """Saves the first map that it receives."""

    NODE_NAME = "grid_map_to_image_demo"

    def __init__(self) -> None:
        super().__init__()
        topic = self.read_topic("grid_map_topic", "/grid_map", "topic of the map")
        about = "image file in an existing folder; its ending sets the format"
        self._file = self.read_path("file", "~/.ros/grid_map.png", about)
        self._picture = self._read_picture()
        self._check_file()
        self._subscription = MapSubscription(self, topic, self._receive)
        self.get_logger().info(f"saves {self._picture.layer!r} of {topic} to {self._file}")

    def _read_picture(self) -> Picture:
        layer = self.read("layer", "elevation", "layer that is saved")
        bits = self.read("bits", 8, "8 or 16 bits per channel")
        check(bits in DTYPES, "bits", "8 or 16", bits)
        about = "the layer holds packed colors; true by default only for `color`"
        is_color = self.read("is_color", layer == COLOR_LAYER, about)
        about = "cells without a value are transparent instead of black"
        is_transparent = self.read("use_transparency", False, about)
        # A bound that is not given is NaN.
        low = self.read("lower", math.nan, "value of black; nan for the smallest")
        high = self.read("upper", math.nan, "value of white; nan for the largest")
        lower, upper = (None if math.isnan(bound) else bound for bound in (low, high))
        return Picture(
            layer=layer,
            bits=bits,
            is_color=is_color,
            is_transparent=is_transparent,
            lower=lower,
            upper=upper,
        )

    def _check_file(self) -> None:
        """Raise `ConfigError` for an unusable file before the first map."""
        file = str(self._file)
        check(self._file.parent.is_dir(), "file", "a file in a folder that exists", file)
        expected = f"a format such as .png, that can hold {self._picture.bits} bits"
        if self._picture.is_transparent:
            expected += " and transparency"
        check(self._picture.fits(self._file), "file", expected, file)

    def _receive(self, received: ReceivedMap) -> None:
        try:
            self._save(received.decode([self._picture.layer]))
        except MessageError:
            raise
        except GridMapError as error:
            raise NodeFailedError(str(error)) from error

    def _save(self, grid_map: GridMap) -> None:
        image = self._picture.draw(grid_map)
        with storage_errors(self._file, "written"), new_file(self._file) as temporary:
            temporary.write_bytes(encode(image, self._file))
        self.get_logger().info(f"saved {image.shape[0]} x {image.shape[1]} pixels to {self._file}")
        try_shutdown()


if __name__ == "__main__":
    raise SystemExit(GridMapToImageDemoNode.main())
