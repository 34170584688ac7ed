# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Multi-layer grid maps in NumPy, without ROS.

A `GridMap` holds named float32 layers over one rectangular grid of cells and follows a robot
without copying its data. `cells` picks regions of it; `image`, `costmap`, `point_cloud` and `mesh`
turn other data into layers and back; `statistics` skips missing data; `testing` has assertions and
hypothesis strategies.
"""

from .arrays._statistics import (
    max_of_finites,
    mean_of_finites,
    min_of_finites,
    number_of_finites,
    sum_of_finites,
)
from .conversions._color import color_value_to_vector, color_vector_to_value
from .errors import (
    ConfigError,
    GeometryError,
    GridMapError,
    LayerNotFoundError,
    MissingPackageError,
    OutOfMapError,
)
from .map._geometry import GridGeometry
from .map._grid_map import GridMap
from .map._interpolation import Interpolation
from .map._ring_buffer import BufferRegion
from .map._signed_distance_field import SignedDistanceField
from .regions import (
    cells_to_mask,
    circle_cells,
    ellipse_cells,
    line_cells,
    line_cells_between,
    map_cells,
    polygon_cells,
    sliding_windows,
    spiral_cells,
    submap_cells,
    window_array,
)
from .regions._polygon import Polygon

__version__ = "0.2.0"

__all__ = [
    "BufferRegion",
    "ConfigError",
    "GeometryError",
    "GridGeometry",
    "GridMap",
    "GridMapError",
    "Interpolation",
    "LayerNotFoundError",
    "MissingPackageError",
    "OutOfMapError",
    "Polygon",
    "SignedDistanceField",
    "cells_to_mask",
    "circle_cells",
    "color_value_to_vector",
    "color_vector_to_value",
    "ellipse_cells",
    "line_cells",
    "line_cells_between",
    "map_cells",
    "max_of_finites",
    "mean_of_finites",
    "min_of_finites",
    "number_of_finites",
    "polygon_cells",
    "sliding_windows",
    "spiral_cells",
    "submap_cells",
    "sum_of_finites",
    "window_array",
]
