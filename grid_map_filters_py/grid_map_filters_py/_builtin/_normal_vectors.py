# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/NormalVectorsFilter`"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check

from .._filter import in_map_order
from ..parts._blocks import blocks_of, fill_blocks
from ..parts._disc import disc_reach
from ..parts._normals import normals_of_blocks


@dataclass(frozen=True, kw_only=True)
class NormalVectors:
    """Compute the surface normals of a layer.

    Attributes:
        input_layer: heights [m].
        output_layers_prefix: prefix of the normal layers, which end in `x`, `y` and `z`.
        normal_vector_positive_axis: axis along which the normals have a positive component. In ROS
            parameter files, quote `'y'`: a bare `y` means *true*.
        algorithm: "area" fits a plane to the surrounding disc. "raster" uses the four neighbors.
        radius: radius of the disc [m]; 0 or less selects "raster".
        parallelization_enabled, thread_number: C++ parameter that has no effect.
    """

    input_layer: str
    output_layers_prefix: str
    normal_vector_positive_axis: Literal["x", "y", "z"]
    algorithm: Literal["area", "raster"] = "area"
    radius: float = 0.0
    parallelization_enabled: bool = False
    thread_number: int = -1

    def __post_init__(self) -> None:
        check(math.isfinite(self.radius), "radius", "a finite length [m]", self.radius)

    def reach(self, resolution: float) -> float:
        return disc_reach(self._disc_radius, resolution) if self._disc_radius else 1

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        heights, resolution = grid_map[self.input_layer], grid_map.resolution
        normals_of = normals_of_blocks(heights, self._disc_radius, resolution)
        normals = [np.empty(grid_map.size, np.float32, order="F") for _ in "xyz"]
        blocks = blocks_of(grid_map.size, self.reach(resolution))
        # Differences between very large floats may overflow.
        with np.errstate(over="ignore"):
            fill_blocks(normals, normals_of, [heights], blocks)
        away = normals["xyz".index(self.normal_vector_positive_axis)] < 0
        if away.any():
            for component in normals:
                np.negative(component, out=component, where=away)
        names = (self.output_layers_prefix + axis for axis in "xyz")
        return grid_map.with_layers(dict(zip(names, normals, strict=True)))

    @property
    def _disc_radius(self) -> float:
        """Radius of the disc [m], or 0 for the algorithm "raster"."""
        return max(self.radius, 0.0) if self.algorithm == "area" else 0.0
