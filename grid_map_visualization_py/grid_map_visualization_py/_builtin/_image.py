# SPDX-License-Identifier: BSD-3-Clause
"""Color image of a layer."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from sensor_msgs import msg

from grid_map_core_py import GridMap
from grid_map_ros_py.messages._fields import to_header
from grid_map_ros_py.messages._image import from_pixels

from ..colors import DEFAULT_COLOR_MAP, Coloring


@dataclass(frozen=True, kw_only=True)
class ImageVisualization:
    """Show a layer as an image with one pixel per cell; +x points up and +y points left.

    Attributes:
        layer: layer to show.
        color_mode: "intensity" uses the color map; "color" uses the packed colors in the layer.
        color_map: name of a Matplotlib color map.
        lower: value at the lower end of the color map (default: the smallest value).
        upper: value at the upper end of the color map (default: the largest value).
        invert: reverse the color map.
        encoding: order of the color channels. Cells without a value are transparent in encodings
            with alpha, and gray in all others.
    """

    message_type: ClassVar[type] = msg.Image

    layer: str
    color_mode: Literal["intensity", "color"] = "intensity"
    color_map: str = DEFAULT_COLOR_MAP
    lower: float | None = None
    upper: float | None = None
    invert: bool = False
    encoding: Literal["rgb8", "rgba8", "bgr8", "bgra8"] = "rgb8"

    def __post_init__(self) -> None:
        self._coloring()

    def __call__(self, grid_map: GridMap) -> msg.Image:
        values = grid_map.unwrapped(self.layer)
        pixels = self._coloring()(values)
        if self.encoding.startswith("bgr"):
            pixels = pixels[..., ::-1]
        if "a" in self.encoding:
            alpha = np.where(np.isnan(values), 0, 255).astype(np.uint8)
            pixels = np.concatenate([pixels, alpha[..., None]], axis=-1)
        return from_pixels(pixels, self.encoding, to_header(grid_map))

    def _coloring(self) -> Coloring:
        bounds = self.lower, self.upper
        return Coloring(self.color_mode, self.layer, self.color_map, *bounds, self.invert)
