# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps as what RViz shows: point clouds, occupancy grids, grid cells and markers.

A visualization is a dataclass that is called with a map and returns a message; `registry` finds it
by its YAML name. `visualization_node` publishes what somebody listens to; it alone needs rclpy.
"""

from .registry import VISUALIZATIONS, create
from .visualization import Visualization

__all__ = ["VISUALIZATIONS", "Visualization", "create"]
