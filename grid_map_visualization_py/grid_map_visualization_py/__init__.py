# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps as what RViz shows: surfaces, point clouds, occupancy grids, images and markers.

A visualization is a dataclass that is called with a map and returns a message; `registry` finds it
by its YAML name. `visualization_node` publishes what somebody listens to; the nodes alone need
rclpy. `surface` and `colormaps` turn maps into triangles and colours, `pictures` draws them with
Matplotlib.
"""

from ._registry import VISUALIZATIONS, create
from ._visualization import Visualization

__version__ = "0.2.0"

__all__ = ["VISUALIZATIONS", "Visualization", "create"]
