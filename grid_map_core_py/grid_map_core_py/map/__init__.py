# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The grid map, its geometry, its circular buffer, and interpolation between its cells."""

from ._geometry import GridGeometry
from ._grid_map import GridMap
from ._interpolation import Interpolation
from ._ring_buffer import BufferRegion, unwrapped
from ._signed_distance_field import SignedDistanceField

__all__ = [
    "BufferRegion",
    "GridGeometry",
    "GridMap",
    "Interpolation",
    "SignedDistanceField",
    "unwrapped",
]
