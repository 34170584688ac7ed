# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/SlopeFilter`"""

from dataclasses import dataclass

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Layer, elementwise
from grid_map_core_py.errors import ConfigError

from .._filter import in_map_order
from .._shared.disc_filter import check_radius
from .._shared.normals import Normals, area_normals, raster_normals


@dataclass(frozen=True, kw_only=True)
class Slope:
    """Compute the angle between the surface and the horizontal [rad], in [0, pi / 2].

    It is the angle between the normal and the z axis, atan(hypot(x, y) / |z|): what acos(|z|) is,
    without the digits that this loses on gentle slopes.

    Attributes:
        input_layer: heights [m] that the normals are computed from.
        input_layers_prefix: instead of `input_layer`: the normals are in the layers prefix + `x`,
            `y`, `z`.
        output_layer: the result goes there.
        radius: of the disc around each cell that a plane is fitted to [m]; 0 takes the slopes to
            the four neighbours.
    """

    input_layer: str | None = None
    input_layers_prefix: str | None = None
    output_layer: str
    radius: float = 0.0

    def __post_init__(self) -> None:
        if (self.input_layer is None) == (self.input_layers_prefix is None):
            raise ConfigError("expected exactly one of 'input_layer' and 'input_layers_prefix'")
        if self.input_layers_prefix is not None and self.radius:
            raise ConfigError("expected no 'radius' beside 'input_layers_prefix'")
        check_radius(self.radius)

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        x, y, z = self._normals(grid_map)
        slope = elementwise(_slope, np.float32, x, y, z)
        return grid_map.with_layers({self.output_layer: slope})

    def _normals(self, grid_map: GridMap) -> Normals:
        if self.input_layers_prefix is not None:
            x, y, z = (grid_map[self.input_layers_prefix + axis] for axis in "xyz")
            return x, y, z
        heights = grid_map[self.input_layer or ""]
        if self.radius:
            return area_normals(heights, self.radius, grid_map.resolution)
        return raster_normals(heights, grid_map.resolution)


def _slope(x: Layer, y: Layer, z: Layer) -> Layer:
    with np.errstate(invalid="ignore"):
        slope: Layer = np.arctan2(np.hypot(x, y), np.abs(z))
    return slope
