# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps as messages that RViz shows, and as pictures.

A visualization is a frozen dataclass that turns a map into a message: a surface, a point cloud, an
image, an occupancy grid or a marker. `create` makes one from its YAML parameters, and
`VISUALIZATIONS` finds its class by the YAML type name.

Pictures need no ROS: `pictures` draws maps with Matplotlib, `colors` turns values into colors, and
`surface` turns heights into triangles.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._registry import VISUALIZATIONS, Visualization, create

__version__ = "0.2.0"

__all__ = ["VISUALIZATIONS", "Visualization", "create"]


def __getattr__(name: str) -> Any:
    # Loaded on first use, because the built-in visualizations import message packages.
    if name in __all__:
        from . import _registry

        return getattr(_registry, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
