# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Cells of an ellipse."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..arrays._checks import Cells, Mask, Positions, as_number, as_pair
from ..errors import GeometryError
from ..map._geometry import BORDER_TOLERANCE
from ._assembly import cells_inside

if TYPE_CHECKING:
    from ..map._grid_map import GridMap


def ellipse_cells(
    grid_map: GridMap, center: ArrayLike, length: ArrayLike, rotation: float = 0.0
) -> Cells:
    """Return the cells (rows, cols) whose center is in an ellipse, row after row.

    With u and v the coordinates along the axes, these are the centers with
    u^2 / (length_x / 2)^2 + v^2 / (length_y / 2)^2 <= 1, in floating point: unlike the rim of
    `circle_cells`, this one has no tolerance. Cells beyond the map are left out.

    Args:
        center: (2,) center of the ellipse [m]; it may be outside the map.
        length: (2,) lengths of the full axes [m], along x and y before the rotation; if one is 0,
            there are no cells.
        rotation: counter-clockwise [rad].

    Raises:
        GeometryError: a length is negative, or a number is not finite.
    """
    center, half_axes = as_pair(center, "center"), 0.5 * as_pair(length, "length")
    if (half_axes < 0).any():
        raise GeometryError(f"length: expected no negative numbers, got {length!r}")
    angle = as_number(rotation, "rotation")
    if not math.isfinite(angle):
        raise GeometryError(f"rotation: expected a finite angle [rad], got {rotation!r}")
    cosine, sine = math.cos(angle), math.sin(angle)
    (center_x, center_y), (squared_a, squared_b) = center, half_axes**2

    def contains(x: Positions, y: Positions) -> Mask:
        x, y = x - center_x, y - center_y
        along, across = cosine * x + sine * y, sine * x - cosine * y
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
            inside: Mask = along**2 / squared_a + across**2 / squared_b <= 1.0
        return inside

    a, b = half_axes
    reach = np.hypot((a * cosine, a * sine), (b * sine, b * cosine))
    reach += BORDER_TOLERANCE
    return cells_inside(grid_map, center - reach, center + reach, contains)
