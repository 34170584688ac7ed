# SPDX-License-Identifier: BSD-3-Clause
"""Built-in visualizations, one per module. The module name is the YAML type."""

from ._contours import ContoursVisualization as ContoursVisualization
from ._flat_point_cloud import FlatPointCloudVisualization as FlatPointCloudVisualization
from ._grid_cells import GridCellsVisualization as GridCellsVisualization
from ._image import ImageVisualization as ImageVisualization
from ._map_region import MapRegionVisualization as MapRegionVisualization
from ._occupancy_grid import OccupancyGridVisualization as OccupancyGridVisualization
from ._point_cloud import PointCloudVisualization as PointCloudVisualization
from ._surface import SurfaceVisualization as SurfaceVisualization
from ._vectors import VectorsVisualization as VectorsVisualization

__all__ = [name for name in dir() if not name.startswith("_")]
