# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/PlanarRegionsFilter`"""

from collections.abc import Container
from dataclasses import dataclass

from grid_map_core_py import GridMap
from grid_map_core_py.planes import PlaneParameters, extract_planes
from grid_map_core_py.planes._parameters import ContourExtraction, Preprocessing, SlidingWindow

from .._filter import WHOLE_MAP, in_map_order


@dataclass(frozen=True, kw_only=True)
class PlanarRegions(ContourExtraction, Preprocessing, SlidingWindow):
    """Find and number the planar regions of a map; see `grid_map_core_py.planes.extract_planes`.

    Attributes:
        input_layer: heights [m].
        output_layer: region number of each cell; 0 means no region. The number of a region may
            differ between maps.
    """

    input_layer: str
    output_layer: str

    def reach(self, _resolution: float) -> float:
        return WHOLE_MAP

    def why_whole_map(self, _names: Container[str]) -> str:
        return "a region may extend over the whole map"

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        parameters = PlaneParameters(
            preprocessing=self, sliding_window_plane_extractor=self, contour_extraction=self
        )
        regions = extract_planes(grid_map, self.input_layer, parameters)
        return grid_map.with_layers({self.output_layer: regions.layers()["plane_id"]})
