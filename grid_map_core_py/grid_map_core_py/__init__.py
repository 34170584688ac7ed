# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Multi-layer grid maps in NumPy, without ROS.

A `GridMap` holds named float32 layers over one rectangular grid of cells and follows a robot
without copying its data. `cells` picks regions of it; `testing` has assertions and hypothesis
strategies.
"""

from .cells import circle_cells, map_cells, submap_cells
from .color import color_value_to_vector, color_vector_to_value
from .errors import (
    ConfigError,
    GeometryError,
    GridMapError,
    LayerNotFoundError,
    OutOfMapError,
)
from .geometry import GridGeometry
from .grid_map import GridMap
from .ring_buffer import BufferRegion

__all__ = [
    "BufferRegion",
    "ConfigError",
    "GeometryError",
    "GridGeometry",
    "GridMap",
    "GridMapError",
    "LayerNotFoundError",
    "OutOfMapError",
    "circle_cells",
    "color_value_to_vector",
    "color_vector_to_value",
    "map_cells",
    "submap_cells",
]
