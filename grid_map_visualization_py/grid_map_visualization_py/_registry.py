# SPDX-License-Identifier: BSD-3-Clause
"""Registry of visualizations by YAML type name.

Other packages add types through the entry-point group `grid_map_visualization_py.visualizations`.
An entry point has the type name as its name, and a `Visualization` class as its value.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol

from grid_map_core_py import GridMap
from grid_map_core_py._parameters import build, descriptions, with_checked_names
from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_core_py.plugins import Registry, check

from . import _builtin


class Visualization(Protocol):
    """Frozen dataclass that converts maps to messages; its fields are the YAML parameters.

    Attributes:
        message_type: class of the returned messages.
    """

    message_type: ClassVar[type]

    def __call__(self, grid_map: GridMap) -> Any:
        """Convert a map to a message of type `message_type`, or to the CDR bytes of the message.

        Raises:
            LayerNotFoundError: the map lacks a layer.
        """


BUILT_IN: Mapping[str, type[Visualization]] = {
    cls.__module__.rpartition("._")[2]: with_checked_names(cls)
    for cls in (getattr(_builtin, name) for name in _builtin.__all__)
}
"""Built-in visualization classes. The keys are YAML type names, which equal the module names."""

VISUALIZATIONS: Registry[Visualization] = Registry(
    BUILT_IN, "grid_map_visualization_py.visualizations"
)
"""All types: `VISUALIZATIONS["vectors"]` is a class, and `VISUALIZATIONS.types` lists the names."""


def describe_parameters(config: Mapping[str, object]) -> dict[str, str]:
    """Return the descriptions of YAML parameters; the keys are names such as `params.layer`."""
    try:
        meanings = descriptions(VISUALIZATIONS[str(config.get("type"))])
    except ConfigError:
        meanings = {}
    named = {f"params.{name}": meaning for name, meaning in meanings.items()}
    return {"type": "type of the visualization", **named}


def create(name: str, config: Mapping[str, object]) -> Visualization:
    """Create a visualization from its YAML parameters.

    Args:
        name: name of the visualization in the parameter file, for error messages.
        config: mapping with `type` (name of the type) and `params` (values by parameter name).

    Raises:
        ConfigError: the type or a parameter is unknown, missing or invalid, or a package is not
            installed.
    """
    type_name: Any = config.get("type")
    # ROS passes an empty mapping as an unset parameter, which is None here.
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
