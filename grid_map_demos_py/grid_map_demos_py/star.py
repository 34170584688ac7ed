# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A map with a star; its sharp edges show the effect of image operations."""

import math

from grid_map_core_py import GridMap, polygon_cells

HEIGHT = 0.3

VERTICES = [
    (0.480, 0.000),
    (0.164, 0.155),
    (0.116, 0.500),
    (-0.133, 0.250),
    (-0.480, 0.399),
    (-0.316, 0.000),
    (-0.480, -0.399),
    (-0.133, -0.250),
    (0.116, -0.500),
    (0.164, -0.155),
]


def star_map(layer: str, resolution: float, *, has_ground: bool = True) -> GridMap:
    """Return a map of 1.2 m x 2 m in the frame `map`, with a star of 0.3 m height.

    Args:
        layer: name of the layer of heights [m].
        resolution: side of a cell [m].
        has_ground: set cells around the star to 0; otherwise they are NaN.
    """
    ground = 0.0 if has_ground else math.nan
    grid_map = GridMap((1.2, 2.0), resolution, layers={layer: ground}, frame_id="map")
    grid_map[layer][polygon_cells(grid_map, VERTICES)] = HEIGHT
    return grid_map
