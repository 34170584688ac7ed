# SPDX-License-Identifier: BSD-3-Clause
"""Convert grid maps to messages for RViz, and draw pictures of grid maps.

A visualization is a frozen dataclass that converts a map to a message: a surface, a point cloud, an
image, an occupancy grid or a marker. `create` creates a visualization from YAML parameters, and
`VISUALIZATIONS` maps YAML type names to visualization classes.

Pictures need no ROS: `pictures` draws maps with Matplotlib, `colors` converts values to colors, and
`surface` converts heights to triangles.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._registry import VISUALIZATIONS, Visualization, create

__version__ = "0.2.0"

__all__ = ["VISUALIZATIONS", "Visualization", "create"]


def __getattr__(name: str) -> Any:
    # Imported lazily, because the built-in visualizations import message packages.
    if name in __all__:
        from . import _registry

        return getattr(_registry, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
