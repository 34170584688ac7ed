# SPDX-License-Identifier: BSD-3-Clause
"""Slow, simple reference versions of the timed operations, for single cells."""

import numpy as np

from grid_map_core_py import GridMap

PROBES = ((0, 0), (3, 50), (77, 120), (150, 31), (199, 199))
"""Cells to check; every benchmark map contains them."""


def disc_points(grid_map: GridMap, layer: str, cell: tuple[int, int], radius: float) -> np.ndarray:
    """Return the points (N, 3) of the finite cells within a radius of a cell."""
    center = grid_map.get_position(cell)
    reach = int(radius / grid_map.resolution) + 1
    points = []
    for row in range(max(0, cell[0] - reach), min(grid_map.size[0], cell[0] + reach + 1)):
        for column in range(max(0, cell[1] - reach), min(grid_map.size[1], cell[1] + reach + 1)):
            point = grid_map.get_position3(layer, (row, column))
            if np.linalg.norm(point[:2] - center) <= radius + 1e-9:
                points.append(point)
    return np.array(points)


def normal_of(points: np.ndarray) -> np.ndarray:
    """Return the upward normal (3,) of the plane through (N, 3) points."""
    normal = np.linalg.svd(points - points.mean(axis=0))[2][2]
    return normal * np.sign(normal[2])


def window(layer: np.ndarray, cell: tuple[int, int], size: int) -> np.ndarray:
    """Return the values in a square window around a cell, cropped to the map."""
    rows, columns = (slice(max(0, place - size // 2), place + size // 2 + 1) for place in cell)
    return layer[rows, columns].astype(np.float64)
