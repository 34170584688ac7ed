# SPDX-License-Identifier: BSD-3-Clause
"""Node `resolution_change_demo`: varies the resolution of a map between 1 cm and 9 cm.

OpenCV resizes the layers. The node publishes `grid_map` with a star in the layer `elevation`.
"""

import math

from grid_map_core_py import GridMap
from grid_map_core_py.conversions import change_resolution

from .demo import Demo
from .parts import star_map

INTERPOLATIONS = "nearest", "linear", "cubic", "area", "lanczos"


def resolution_at(seconds: float) -> float:
    """Return a resolution between 0.01 and 0.09 m that oscillates with a period of 2 pi s."""
    return 0.05 + 0.04 * math.sin(seconds)


class ResolutionChangeDemoNode(Demo):
    """Node that publishes the star at a varying resolution."""

    def __init__(self) -> None:
        super().__init__("resolution_change_demo")
        transparent = self.read("use_transparency", False, "cells around the star have no value")
        about = f"interpolation method: {', '.join(INTERPOLATIONS)}"
        self._interpolation = self.read_choice("interpolation", INTERPOLATIONS, "cubic", about)
        self._map = star_map("elevation", 0.03, has_ground=not transparent)
        self.publish_maps(10.0)

    def map_at(self, seconds: float) -> GridMap:
        return change_resolution(self._map, resolution_at(seconds), self._interpolation)


if __name__ == "__main__":
    raise SystemExit(ResolutionChangeDemoNode.main())
