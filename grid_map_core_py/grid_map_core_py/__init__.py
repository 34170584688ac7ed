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

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .arrays import (
        max_of_finites,
        mean_of_finites,
        min_of_finites,
        number_of_finites,
        sum_of_finites,
    )
    from .conversions import (
        change_resolution,
        color_value_to_vector,
        color_vector_to_value,
        from_image,
        from_mesh,
        from_points,
        to_image,
    )
    from .errors import (
        ConfigError,
        GeometryError,
        GridMapError,
        LayerNotFoundError,
        MissingPackageError,
        OutOfMapError,
    )
    from .files import load, save
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

_ROOMS = (
    "errors",
    "arrays",
    "map",
    "regions",
    "conversions",
    "files",
    "elevation",
    "plugins",
    "testing",
)
"""Rooms; each imports only earlier ones. A name is searched in them when it is first used, so that
programs such as `grid-map --help` need not wait for NumPy, SciPy and OpenCV."""


def __getattr__(name: str) -> Any:
    if name in _ROOMS:
        return import_module(f"{__name__}.{name}")
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    rooms = (import_module(f"{__name__}.{room}") for room in _ROOMS)
    found = next(getattr(room, name) for room in rooms if name in room.__all__)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return [*__all__, *_ROOMS, *(name for name in globals() if name.startswith("__"))]
