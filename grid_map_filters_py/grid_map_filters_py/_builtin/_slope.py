# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/SlopeFilter`"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Layer
from grid_map_core_py.errors import ConfigError

from .._filter import in_map_order
from ..parts._blocks import blockwise
from ..parts._disc import disc_reach
from ..parts._layer_filter import check_radius
from ..parts._normals import normals_of_blocks


@dataclass(frozen=True, kw_only=True)
class Slope:
    """Compute the angle between the surface and the horizontal [rad], in [0, pi / 2].

    For a surface normal (x, y, z), the slope is atan(hypot(x, y) / |z|). This equals acos(|z|), but
    does not lose precision on gentle slopes.

    Attributes:
        input_layer: heights [m].
        input_layers_prefix: common prefix of the normal layers, which end in `x`, `y` and `z`;
            replaces `input_layer`.
        output_layer: layer for the result.
        radius: radius of the disc for the plane fit [m]; if 0, the four neighbors are used.
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

    def reach(self, resolution: float) -> float:
        if self.input_layer is None:
            return 0
        return disc_reach(self.radius, resolution) if self.radius else 1

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        if self.input_layers_prefix is None:
            heights, resolution = grid_map[self.input_layer or ""], grid_map.resolution
            normals_of = normals_of_blocks(heights, self.radius, resolution)
            reach = self.reach(resolution)
            slope = blockwise(lambda block: _slope(*normals_of(block)), heights, reach=reach)
        else:
            normals = (grid_map[self.input_layers_prefix + axis] for axis in "xyz")
            slope = blockwise(_slope, *normals)
        return grid_map.with_layers({self.output_layer: slope})


def _slope(*normal: npt.NDArray[np.floating[Any]]) -> Layer:
    x, y, z = (component.astype(np.float32, copy=False) for component in normal)
    with np.errstate(invalid="ignore", over="ignore"):
        slope: Layer = np.arctan2(np.hypot(x, y), np.abs(z))
    return slope
