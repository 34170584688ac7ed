# SPDX-License-Identifier: BSD-3-Clause
"""Node `opencv_demo`: converts a layer to an image and blurs it with OpenCV.

The node publishes `grid_map` with two layers: `original` is a star with sharp edges, and
`elevation` is the star after a Gaussian blur. The blur kernel shrinks and grows.
"""

import math

import cv2
import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import add_layer_from_image, to_image
from grid_map_core_py.conversions._image_arrays import Image

from .demo import Demo
from .parts import HEIGHT, star_map

LARGEST_WIDTH = 200  # side of the largest kernel, minus 1 [pixels]


def kernel_size(seconds: float) -> int:
    """Return an odd kernel size [pixels] that varies from 201 to 1 and back every pi seconds."""
    width = LARGEST_WIDTH - int(LARGEST_WIDTH * abs(math.sin(seconds)))
    return 2 * (width // 2) + 1


def blur(grid_map: GridMap, image: Image, size: int) -> None:
    """Blur an image with a `size` x `size` kernel, and store it in the layer `elevation`."""
    blurred = cv2.GaussianBlur(image, (size, size), 0.0)
    # Blurred cells with a lower opacity become NaN.
    add_layer_from_image(grid_map, blurred, "elevation", 0.0, HEIGHT, alpha_threshold=0.3)


class OpencvDemoNode(Demo):
    """Node that blurs the star and publishes it."""

    def __init__(self) -> None:
        super().__init__("opencv_demo")
        about = "omit the ground around the star; cells without a value become transparent pixels"
        transparent = self.read("use_transparency", False, about)
        self._map = star_map("original", 0.01, has_ground=not transparent)
        # 16 bits distinguish 65536 heights; the fourth channel is alpha.
        channels = 4 if transparent else 1
        self._image = to_image(self._map, "original", np.uint16, channels, 0.0, HEIGHT)
        self.publish_maps(25.0)

    def map_at(self, seconds: float) -> GridMap:
        blur(self._map, self._image, kernel_size(seconds))
        return self._map


if __name__ == "__main__":
    raise SystemExit(OpencvDemoNode.main())
