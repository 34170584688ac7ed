# SPDX-License-Identifier: BSD-3-Clause
"""Helpers of the demos: a star with sharp edges, weighted means, and tables as text."""

import math
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap, polygon_cells

HEIGHT = 0.3

VERTICES = [
    (0.480, 0.000),
    (0.164, 0.155),
    (0.116, 0.500),
    (-0.133, 0.250),
    (-0.480, 0.399),
    (-0.316, 0.000),
    (-0.480, -0.399),
    (-0.133, -0.250),
    (0.116, -0.500),
    (0.164, -0.155),
]


def star_map(layer: str, resolution: float, *, has_ground: bool = True) -> GridMap:
    """Return a 1.2 m x 2 m map of a star, 0.3 m high, on the ground or surrounded by NaN."""
    ground = 0.0 if has_ground else math.nan
    geometry = GridGeometry((1.2, 2.0), resolution)
    grid_map = GridMap.from_geometry(geometry, {layer: ground}, frame_id="map")
    grid_map[layer][polygon_cells(grid_map, VERTICES)] = HEIGHT
    return grid_map


def weighted_means(
    layer: npt.NDArray[np.floating], radius: float, resolution: float
) -> npt.NDArray[np.float64]:
    """Return the weighted mean of the finite values around each cell; NaN if there are none.

    A value at distance d has the weight (1 - d / radius)**2. Values beyond the radius are ignored.
    """
    reach = int(radius / resolution)
    steps = resolution * np.arange(-reach, reach + 1)
    weights = np.maximum(1.0 - np.hypot(steps[:, None], steps) / radius, 0.0) ** 2
    is_finite = np.isfinite(layer)
    sums, total = (
        cv2.filter2D(values.astype(np.float64), -1, weights, borderType=cv2.BORDER_CONSTANT)
        for values in (np.where(is_finite, layer, 0.0), is_finite)
    )
    return np.divide(sums, total, out=np.full_like(sums, np.nan), where=total > 1e-12)


def to_text(tables: Mapping[str, Mapping[Any, object]]) -> str:
    """Format tables and their titles as text; each row is a name and a value."""
    sections = []
    for title, table in tables.items():
        width = max((len(str(name)) for name in table), default=0)
        lines = [f"  {name!s:<{width}}  {value!s:>10}".rstrip() for name, value in table.items()]
        sections.append("\n".join([title, *lines]))
    return "\n\n".join(sections)
