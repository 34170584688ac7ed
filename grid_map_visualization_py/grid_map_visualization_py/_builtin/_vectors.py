# SPDX-License-Identifier: BSD-3-Clause
"""Lines along vectors such as surface normals."""

import math
from dataclasses import dataclass

import numpy as np
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check

from .._markers import LineMarker


@dataclass(frozen=True, kw_only=True)
class VectorsVisualization(LineMarker):
    """Draw the vector of each cell as a line that starts at the surface.

    Attributes:
        layer_prefix: prefix of the component layers, which end in `x`, `y` and `z`.
        position_layer: layer with the heights [m] at which the lines start.
        scale: line length [m] of a vector with length 1.
    """

    layer_prefix: str
    position_layer: str
    scale: float = 1.0
    color: int = 0x00FF00

    def __post_init__(self) -> None:
        super().__post_init__()
        check(math.isfinite(self.scale), "scale", "a finite number", self.scale)

    def __call__(self, grid_map: GridMap) -> bytes:
        components = [f"{self.layer_prefix}{axis}" for axis in "xyz"]
        valid = grid_map.valid_mask((self.position_layer, *components)).ravel("F")
        # Start and end of each line, in column-major order of the buffer.
        lines = np.empty((np.count_nonzero(valid), 2, 3))
        lines[:, 0, :2] = grid_map.get_positions()[valid]
        lines[:, 0, 2] = grid_map[self.position_layer].ravel("F")[valid]
        for axis, layer in enumerate(components):
            lines[:, 1, axis] = grid_map[layer].ravel("F")[valid]
        lines[:, 1] = lines[:, 0] + self.scale * lines[:, 1]
        return self.marker(grid_map, lines.reshape(-1, 3), Marker.LINE_LIST, "vector")
