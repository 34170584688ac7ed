# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The visualizations of this package, one per module, named after their YAML type.

A visualization is created with the parameters that it has in YAML, by keyword, and called with a
map; it returns a message.
"""

from ._contours import ContoursVisualization
from ._flat_point_cloud import FlatPointCloudVisualization
from ._grid_cells import GridCellsVisualization
from ._image import ImageVisualization
from ._map_region import MapRegionVisualization
from ._occupancy_grid import OccupancyGridVisualization
from ._point_cloud import PointCloudVisualization
from ._surface import SurfaceVisualization
from ._vectors import VectorsVisualization

__all__ = [
    "ContoursVisualization",
    "FlatPointCloudVisualization",
    "GridCellsVisualization",
    "ImageVisualization",
    "MapRegionVisualization",
    "OccupancyGridVisualization",
    "PointCloudVisualization",
    "SurfaceVisualization",
    "VectorsVisualization",
]
