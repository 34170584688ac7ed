# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The visualizations by the names under which YAML files ask for them.

Other packages add theirs through the entry-point group `grid_map_visualization_py.visualizations`:
the entry's name is the type, its value a class as `Visualization` describes it.
"""

from collections.abc import Mapping
from functools import cache
from importlib.metadata import EntryPoint, entry_points

from grid_map_core_py.config import build
from grid_map_core_py.errors import ConfigError

from .builtin.flat_point_cloud import FlatPointCloud
from .builtin.grid_cells import GridCells
from .builtin.map_region import MapRegion
from .builtin.occupancy_grid import OccupancyGrid
from .builtin.point_cloud import PointCloud
from .builtin.vectors import Vectors
from .visualization import Visualization

GROUP = "grid_map_visualization_py.visualizations"

BUILT_IN: Mapping[str, type[Visualization]] = {
    "flat_point_cloud": FlatPointCloud,
    "grid_cells": GridCells,
    "map_region": MapRegion,
    "occupancy_grid": OccupancyGrid,
    "point_cloud": PointCloud,
    "vectors": Vectors,
}


def create(name: str, config: Mapping[str, object]) -> Visualization:
    """Return the visualization that a parameter file describes.

    Args:
        name: what the user calls it; for messages only.
        config: `type`, a name in the registry, and `params`, its parameters by name.

    Raises:
        ConfigError: the type is missing or unknown, or a parameter is unknown, missing or wrong;
            the message names the visualization, its type and the parameter.
    """
    type_name, parameters = _checked(name, config)
    try:
        return build(visualization_type(type_name), parameters)
    except ConfigError as error:
        raise ConfigError(f"visualization {name!r} of type {type_name!r}: {error}") from error


def _checked(name: str, config: Mapping[str, object]) -> tuple[str, Mapping[str, object]]:
    unknown = sorted(set(config) - {"type", "params"})
    if unknown:
        raise ConfigError(
            f"visualization {name!r}: unknown entry {unknown[0]!r}; known: type, params"
        )
    type_name, parameters = config.get("type"), config.get("params")
    if not isinstance(type_name, str):
        found = "nothing" if type_name is None else repr(type_name)
        raise ConfigError(
            f"visualization {name!r}: type: expected one of {_known()}, found {found}"
        )
    # ROS hands over an empty mapping as a value without type.
    parameters = {} if parameters is None else parameters
    if not isinstance(parameters, Mapping):
        raise ConfigError(
            f"visualization {name!r}: params: expected parameters by name, found {parameters!r}"
        )
    return type_name, parameters


def visualization_type(type_name: str) -> type[Visualization]:
    """Return the class registered under a type name.

    Raises:
        ConfigError: there is none, it cannot be loaded, or two share a name.
    """
    plugins = _plugins()
    if type_name in BUILT_IN:
        return BUILT_IN[type_name]
    if type_name not in plugins:
        raise ConfigError(f"unknown type; known: {_known()}")
    return _load(plugins[type_name])


def _known() -> str:
    return ", ".join(sorted([*BUILT_IN, *_plugins()]))


@cache
def _plugins() -> Mapping[str, EntryPoint]:
    plugins: dict[str, EntryPoint] = {}
    for entry in entry_points(group=GROUP):
        if entry.name in BUILT_IN or entry.name in plugins:
            other = plugins[entry.name].value if entry.name in plugins else "a built-in"
            raise ConfigError(
                f"the type {entry.name!r} is registered twice: as {entry.value} and as {other}"
            )
        plugins[entry.name] = entry
    return plugins


def _load(entry: EntryPoint) -> type[Visualization]:
    try:
        loaded: type[Visualization] = entry.load()
    except Exception as error:  # Whatever a plugin's module raises, the user must learn which one.
        raise ConfigError(f"cannot load {entry.value}: {error}") from error
    return loaded
