# SPDX-License-Identifier: BSD-3-Clause
"""Cells beside each other: the highest one around, and the slope between them."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._arrays._checks import Integers, Size
from ..map._geometry import GridGeometry
from ._sensors import Numbers


def highest_around(
    values: NDArray[Any], size: Size, radius: int = 1, *, itself: bool = True
) -> NDArray[np.float32]:
    """Return the largest value (cells,) up to `radius` cells away from each cell, -inf for none.

    `itself` is False to leave out the value of the cell. NaN values do not count.
    """
    kernel = np.ones((2 * radius + 1, 2 * radius + 1), np.uint8)
    kernel[radius, radius] = itself
    # OpenCV takes a tenth of the time for float32.
    with np.errstate(over="ignore"):
        known = np.fmax(values.astype(np.float32), np.float32(-np.inf)).reshape(size[::-1])
    around: Any = cv2.dilate(known, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=-np.inf)
    found: NDArray[np.float32] = around.ravel()
    return found


def at_centers(
    points: NDArray[np.float64],
    cells: Integers,
    heights: Numbers,
    variances: Numbers,
    geometry: GridGeometry,
    threshold: float,
) -> Numbers:
    """Return heights (n,) of points on a slope, moved along it to the centers of their cells [m].

    The slope along each axis is the smaller one of the differences from both neighbors. Steps,
    where the differences have other signs or one is within the gate, are no slopes.

    Args:
        points: (3, n) on the map.
        cells: (n,) their cells.
        heights, variances: (cells,) of the map.
        threshold: of the gate.
    """
    seen = np.zeros(len(heights), np.bool_)
    seen[cells] = True
    known = np.flatnonzero(seen & ~np.isnan(heights))
    result: Numbers = points[2].copy()
    rows = geometry.size[0]
    lines = (known % rows, cells % rows), (known // rows, cells // rows)
    for axis, (centers, step) in enumerate(
        zip(geometry.axes_in_map_order(), (1, rows), strict=True)
    ):
        line, place = lines[axis]
        rises = []
        for side, is_there in ((-step, line > 0), (step, line < len(centers) - 1)):
            beside = np.where(is_there, known + side, known)
            rise = np.copysign(1.0, side) * (heights[beside] - heights[known])
            gate = threshold * np.sqrt(variances[beside] + variances[known])
            rises.append(np.where(np.abs(rise) > gate, rise, 0.0))
        one, other = rises
        slopes = np.zeros(len(heights))
        smaller = np.where(np.abs(one) < np.abs(other), one, other)
        slopes[known] = np.where(one * other > 0.0, smaller, 0.0)
        sloping = np.flatnonzero(slopes[cells])
        # The axes of a map point from high to low coordinates.
        away = (centers[place[sloping]] - points[axis, sloping]) / geometry.resolution
        result[sloping] -= slopes[cells[sloping]] * away
    return result
