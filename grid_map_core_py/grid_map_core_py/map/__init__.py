# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps: `GridMap`, its geometry, interpolation and signed distance fields.

- `GridMap`: layers over a grid, with moves, submaps, merging, transforms and interpolation.
- `GridGeometry`: size, resolution and place of a grid; positions to cells and back.
- `Interpolation`: the methods of `GridMap.at_position`.
- `BufferRegion` and `unwrapped`: the circular buffer in which layers are stored.
- `is_name` and `select_layers`: names of layers that users give, checked.
- `SignedDistanceField`: distances from points in space to the surface of a layer.
"""

from ._geometry import GridGeometry as GridGeometry
from ._grid_map import GridMap as GridMap
from ._interpolation import Interpolation as Interpolation
from ._ring_buffer import (
    BufferRegion as BufferRegion,
)
from ._signed_distance_field import SignedDistanceField as SignedDistanceField

__all__ = [name for name in dir() if not name.startswith("_")]
