# SPDX-License-Identifier: BSD-3-Clause
"""Convert grid maps to messages for RViz, and draw pictures of grid maps.

A visualization is a frozen dataclass that converts a map to a message: a surface, a point cloud, an
image, an occupancy grid or a marker. `create` creates a visualization from YAML parameters, and
`VISUALIZATIONS` maps YAML type names to visualization classes.

Pictures need no ROS: `pictures` draws maps with Matplotlib, `colors` converts values to colors, and
`surface` converts heights to triangles.
"""

from typing import TYPE_CHECKING

from grid_map_core_py._lazy import lazy_names

if TYPE_CHECKING:
    from ._registry import VISUALIZATIONS, Visualization, create

__all__ = ["VISUALIZATIONS", "Visualization", "create"]

# The built-in visualizations import message packages.
_, __getattr__, __dir__ = lazy_names(__name__, {"._registry": " ".join(__all__)})
