# SPDX-License-Identifier: BSD-3-Clause
"""Loads plot styles of other packages, to avoid a circular dependency.

Each entry point in the group `grid_map_core_py.plots` adds a style to `GridMap.plot`. It refers to
a function that draws the style. The arguments of the function are a map, a layer name, axes, and
options as keyword arguments.
"""

from importlib.metadata import entry_points
from inspect import signature
from typing import Any

from .._parameters import check
from ..errors import ConfigError, MissingPackageError, hint, short

GROUP = "grid_map_core_py.plots"
PACKAGE = "grid_map_visualization_py"


def plot(grid_map: object, layer: str, ax: Any, style: str, options: dict[str, Any]) -> Any:
    """Draw a map; see `GridMap.plot`."""
    styles = {entry.name: entry for entry in entry_points(group=GROUP)}
    if not styles:
        raise MissingPackageError(PACKAGE, "plot")
    check(style in styles, "style", f"one of {', '.join(sorted(styles))}", style)
    draw = styles[style].load()
    known = signature(draw).parameters
    wrong = [name for name in options if name not in known]
    if wrong and not any(one.kind is one.VAR_KEYWORD for one in known.values()):
        found = f"{short(wrong[0])}{hint(wrong[0], known)}"
        raise ConfigError(f"options: expected some of {', '.join([*known][3:])}, got {found}")
    return draw(grid_map, layer, ax, **options)
