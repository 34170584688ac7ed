# SPDX-License-Identifier: BSD-3-Clause
"""Three-dimensional triangle surface."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check
from grid_map_ros_py.messages import serialize
from grid_map_ros_py.messages._fields import to_header

from .. import surface
from ..colors import DEFAULT_COLOR_MAP, Coloring, check_color


@dataclass(frozen=True, kw_only=True)
class SurfaceVisualization:
    """Draw the map as a colored surface of triangles, with holes where heights are missing.

    Attributes:
        height_layer: layer with the heights [m].
        flat: draw the surface at height zero.
        color_mode: "intensity" maps the values of `color_layer` to colors. "color" reads packed
            colors from `color_layer`. "flat" draws the surface in `color`.
        color_layer: layer that determines the colors; empty means `height_layer`.
        color_map: name of a Matplotlib color map.
        lower: value at the lower end of the color map (default: the smallest value).
        upper: value at the upper end of the color map (default: the largest value).
        invert: reverse the color map.
        color: surface color as 0xRRGGBB, used by the color mode "flat".
        opacity: surface opacity, from 0 (invisible) to 1 (opaque).
        max_drawn_cells: maximum number of drawn cells, at least 9; larger maps are downsampled. 0
            means no limit.
    """

    message_type: ClassVar[type] = Marker

    height_layer: str = "elevation"
    flat: bool = False
    color_mode: Literal["intensity", "color", "flat"] = "intensity"
    color_layer: str = ""
    color_map: str = DEFAULT_COLOR_MAP
    lower: float | None = None
    upper: float | None = None
    invert: bool = False
    color: int = 0xC0C0C0
    opacity: float = 1.0
    max_drawn_cells: int = 0

    def __post_init__(self) -> None:
        check_color(self.color)
        check(0 <= self.opacity <= 1, "opacity", "0 to 1", self.opacity)
        surface.check_max_drawn_cells(self.max_drawn_cells)
        self._coloring()

    def __call__(self, grid_map: GridMap) -> bytes:
        cells = surface.Surface(grid_map, self.height_layer, self.flat, self.max_drawn_cells)
        rgb = cells.colors(self._coloring())
        rgba = np.full((len(rgb), 4), self.opacity, np.float32)
        np.divide(rgb, np.float32(255), out=rgba[:, :3])
        corners = cells.triangles.ravel()
        arrays = {
            "points": np.take(cells.points(), corners, axis=0),
            "colors": np.take(rgba, corners, axis=0),
        }
        header = to_header(grid_map)
        marker = Marker(header=header, ns="surface", type=Marker.TRIANGLE_LIST, action=Marker.ADD)
        marker.scale.x = marker.scale.y = marker.scale.z = 1.0
        return serialize(marker, arrays)

    def _coloring(self) -> Coloring:
        scale = self.color_map, self.lower, self.upper, self.invert
        return Coloring(self.color_mode, self.color_layer, *scale, self.color)
