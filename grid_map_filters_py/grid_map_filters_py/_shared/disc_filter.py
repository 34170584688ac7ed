# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Base class and check of the filters that look at the disc around each cell."""

import math
from dataclasses import dataclass

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check

from ..parts._disc import Disc


def check_radius(radius: float, name: str = "radius") -> None:
    """Check the parameter `name` of a filter that looks at a disc around each cell."""
    check(math.isfinite(radius) and radius >= 0, name, "a length >= 0 [m]", radius)


@dataclass(frozen=True, kw_only=True)
class DiscFilter:
    """Base class of filters that make a layer from the disc around each cell.

    Attributes:
        input_layer: layer to filter.
        output_layer: layer for the result.
        radius: radius of the disc [m], 0 or more; the rim is inside.
    """

    input_layer: str
    output_layer: str
    radius: float

    def __post_init__(self) -> None:
        check_radius(self.radius)

    def disc(self, grid_map: GridMap) -> Disc:
        """Return the disc in cells of a map."""
        return Disc(self.radius, grid_map.resolution, grid_map.size)
