# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Registry of visualizations by their YAML type names.

Other packages add types through the entry-point group `grid_map_visualization_py.visualizations`.
The name of an entry point is the type, its object a class that follows `Visualization`.
"""

from collections.abc import Mapping

from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_core_py.plugins import Registry, build

from ._visualization import Visualization
from .builtin._contours import ContoursVisualization
from .builtin._flat_point_cloud import FlatPointCloudVisualization
from .builtin._grid_cells import GridCellsVisualization
from .builtin._image import ImageVisualization
from .builtin._map_region import MapRegionVisualization
from .builtin._occupancy_grid import OccupancyGridVisualization
from .builtin._point_cloud import PointCloudVisualization
from .builtin._surface import SurfaceVisualization
from .builtin._vectors import VectorsVisualization

BUILT_IN: Mapping[str, type[Visualization]] = {
    "contours": ContoursVisualization,
    "flat_point_cloud": FlatPointCloudVisualization,
    "grid_cells": GridCellsVisualization,
    "image": ImageVisualization,
    "map_region": MapRegionVisualization,
    "occupancy_grid": OccupancyGridVisualization,
    "point_cloud": PointCloudVisualization,
    "surface": SurfaceVisualization,
    "vectors": VectorsVisualization,
}

VISUALIZATIONS: Registry[Visualization] = Registry(
    BUILT_IN, "grid_map_visualization_py.visualizations"
)
"""All visualizations: `VISUALIZATIONS["vectors"]`, `VISUALIZATIONS.types`."""


def create(name: str, config: Mapping[str, object]) -> Visualization:
    """Return the visualization that a parameter file describes.

    Args:
        name: name that the user gave it, for error messages.
        config: `type`, a name in the registry, and `params`, its parameters by name.

    Raises:
        ConfigError: the type is missing or unknown, a parameter is unknown, missing or wrong, or a
            package is not installed. The message names the visualization, its type and the cause.
    """
    unknown = sorted(set(config) - {"type", "params"})
    if unknown:
        raise ConfigError(
            f"visualization {name!r}: unknown entry {unknown[0]!r}; known: type, params"
        )
    type_name = config.get("type")
    if not isinstance(type_name, str):
        known = ", ".join(VISUALIZATIONS.types)
        found = "nothing" if type_name is None else repr(type_name)
        raise ConfigError(f"visualization {name!r}: type: expected one of {known}, got {found}")
    # ROS passes an empty mapping as a parameter without type.
    parameters = {} if config.get("params") is None else config["params"]
    if not isinstance(parameters, Mapping):
        raise ConfigError(
            f"visualization {name!r}: params: expected parameters by name, got {parameters!r}"
        )
    try:
        return build(VISUALIZATIONS[type_name], parameters)
    except GridMapError as error:
        raise ConfigError(f"visualization {name!r} of type {type_name!r}: {error}") from error
