# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Multi-layer grid maps in NumPy, without ROS.

- `GridMap`: named float32 layers over a rectangular grid that follows a robot without copying data;
  `GridGeometry`, `Interpolation`, `BufferRegion` and `SignedDistanceField` belong to it.
- Regions: `circle_cells` and its siblings return the cells (rows, cols) of a shape, which index a
  layer; `cells_to_mask`, `sliding_windows`, `window_array`, `Polygon`.
- Conversions: `to_image`, `from_image`, `change_resolution`, `from_points`, `from_mesh`, and colors
  as layer values.
- Files: `load` and `save` choose the format by the name of the file.
- Statistics of finite values: `mean_of_finites` and its siblings.
- Errors: all derive from `GridMapError`.

The rooms `map`, `regions`, `conversions`, `files`, `elevation`, `plugins`, `arrays`, `errors` and
`testing` offer more, each with a list of its own. Conversions and files are imported when they are
first used.
"""

import importlib
from typing import TYPE_CHECKING

from .arrays import (
    max_of_finites,
    mean_of_finites,
    min_of_finites,
    number_of_finites,
    sum_of_finites,
)
from .errors import (
    ConfigError,
    GeometryError,
    GridMapError,
    LayerNotFoundError,
    MissingPackageError,
    OutOfMapError,
)
from .map import BufferRegion, GridGeometry, GridMap, Interpolation, SignedDistanceField
from .regions import (
    Polygon,
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

if TYPE_CHECKING:
    from .conversions import (
        change_resolution,
        color_value_to_vector,
        color_vector_to_value,
        from_image,
        from_mesh,
        from_points,
        to_image,
    )
    from .files import load, save

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
    "change_resolution",
    "circle_cells",
    "color_value_to_vector",
    "color_vector_to_value",
    "ellipse_cells",
    "from_image",
    "from_mesh",
    "from_points",
    "line_cells",
    "line_cells_between",
    "load",
    "map_cells",
    "max_of_finites",
    "mean_of_finites",
    "min_of_finites",
    "number_of_finites",
    "polygon_cells",
    "save",
    "sliding_windows",
    "spiral_cells",
    "submap_cells",
    "sum_of_finites",
    "to_image",
    "window_array",
]

_IMPORTED_ON_USE = {
    "change_resolution": "conversions",
    "color_value_to_vector": "conversions",
    "color_vector_to_value": "conversions",
    "from_image": "conversions",
    "from_mesh": "conversions",
    "from_points": "conversions",
    "to_image": "conversions",
    "load": "files",
    "save": "files",
}
"""Room of each name whose import would more than double the time that the package takes."""

_ROOMS = {"conversions", "elevation", "files", "plugins", "testing"}
"""Rooms that are not imported with the package, but found as its attributes."""


def __getattr__(name: str) -> object:
    if name in _ROOMS:
        return importlib.import_module(f".{name}", __name__)
    if name not in _IMPORTED_ON_USE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_IMPORTED_ON_USE[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_ROOMS})
