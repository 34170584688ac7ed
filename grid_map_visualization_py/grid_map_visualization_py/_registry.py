# SPDX-License-Identifier: BSD-3-Clause
"""Registry of visualizations by their YAML type names.

Other packages add types through the entry-point group `grid_map_visualization_py.visualizations`.
The name of an entry point is the type, its object a class that follows `Visualization`.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

from grid_map_core_py import GridMap
from grid_map_core_py._parameters import build, descriptions
from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_core_py.plugins import Registry, check

from . import _builtin


class Visualization(Protocol):
    """A frozen dataclass whose fields are its YAML parameters, called with a map.

    Attributes:
        message_type: class of the messages that it makes.
    """

    message_type: ClassVar[type]

    def __call__(self, grid_map: GridMap) -> Any:
        """Return a message of `message_type`, or its CDR bytes: publishers accept both.

        Raises:
            LayerNotFoundError: the map lacks a layer.
        """


BUILT_IN: Mapping[str, type[Visualization]] = {
    cls.__module__.rpartition("._")[2]: cls
    for cls in (getattr(_builtin, name) for name in _builtin.__all__)
}
"""The built-in visualizations, by the names of their modules."""

VISUALIZATIONS: Registry[Visualization] = Registry(
    BUILT_IN, "grid_map_visualization_py.visualizations"
)
"""All visualizations: `VISUALIZATIONS["vectors"]`, `VISUALIZATIONS.types`."""


def describe_parameters(config: Mapping[str, object]) -> dict[str, str]:
    """Return descriptions of the parameters of a visualization: `type`, `params.layer`, ..."""
    try:
        meanings = descriptions(VISUALIZATIONS[str(config.get("type"))])
    except ConfigError:
        meanings = {}
    named = {f"params.{name}": meaning for name, meaning in meanings.items()}
    return {"type": "type of the visualization", **named}


def create(name: str, config: Mapping[str, object]) -> Visualization:
    """Return the visualization that a parameter file describes.

    Args:
        name: name that the user gave it, for error messages.
        config: `type`, a name in the registry, and `params`, its parameters by name.

    Raises:
        ConfigError: the type is missing or unknown, a parameter is unknown, missing or wrong, or a
            package is not installed. The message names the visualization, its type and the cause.
    """
    type_name: Any = config.get("type")
    # ROS passes an empty mapping as a parameter without type.
    parameters: Any = {} if config.get("params") is None else config["params"]
    try:
        unknown = sorted({*config} - {"type", "params"})
        check(not unknown, "entries", "type and params", unknown)
        known = f"one of {', '.join(VISUALIZATIONS.types)}"
        check(isinstance(type_name, str), "type", known, type_name)
        check(isinstance(parameters, Mapping), "params", "parameters by name", parameters)
        return build(VISUALIZATIONS[type_name], parameters)
    except GridMapError as error:
        raise ConfigError(f"visualization {name!r} of type {type_name!r}: {error}") from error
