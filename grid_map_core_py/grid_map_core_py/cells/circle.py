# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The cells of a disc."""

import math

import numpy as np
import numpy.typing as npt

from ..arrays import Cells, as_number, as_pair
from ..errors import GeometryError
from ..geometry import BORDER_TOLERANCE
from ..grid_map import GridMap
from ._inside import cells_inside


def circle_cells(grid_map: GridMap, center: npt.ArrayLike, radius: float) -> Cells:
    """Return the (N, 2) buffer indices of the cells whose centre lies in a disc, row after row.

    The disc is closed: a centre within 1e-9 m of the rim is inside. Cells beyond the map are left
    out.

    Args:
        center: (2,) centre of the disc [m]; it may lie outside the map.
        radius: [m], not negative.

    Raises:
        GeometryError: the radius is negative, or a number is not finite.
    """
    radius = as_number(radius, "radius")
    if not (math.isfinite(radius) and radius >= 0):
        raise GeometryError(f"radius: expected a finite number >= 0, got {radius!r}")
    centre = as_pair(center, "center")
    limit = radius + BORDER_TOLERANCE
    return cells_inside(
        grid_map,
        centre - radius,
        centre + radius,
        lambda x, y: np.hypot(x - centre[0], y - centre[1]) <= limit,
    )
