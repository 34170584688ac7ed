# SPDX-License-Identifier: BSD-3-Clause
"""Grid maps: `GridMap`, its geometry, interpolation and signed distance fields.

- `GridMap`: named layers over a grid. It can be moved, cut, merged, transformed and interpolated.
- `GridGeometry`: size, resolution and position of a grid; converts positions to cells and back.
- `Interpolation`: interpolation methods of `GridMap.at_position`.
- `BufferRegion`: a rectangle of the circular buffer in which layers are stored.
- `SignedDistanceField`: distances from points in space to the surface of a layer.
"""

from .. import _lazy
from ._geometry import GridGeometry as GridGeometry
from ._grid_map import GridMap as GridMap
from ._interpolation import Interpolation as Interpolation
from ._ring_buffer import BufferRegion as BufferRegion
from ._signed_distance_field import SignedDistanceField as SignedDistanceField

__all__, __dir__ = _lazy.public_names(dir())
