# SPDX-License-Identifier: BSD-3-Clause
"""The terrain on which the C++ library was timed."""

from functools import cache

import numpy as np

from grid_map_core_py import GridMap
from grid_map_filters_py._builtin import NormalVectors

RESOLUTION = 0.05
SEED = 12345
MULTIPLIER, INCREMENT = 1664525, 1013904223


def terrain(cells: int, *, layers: int = 1) -> GridMap:
    """Return a square map with `elevation`, 5 % of it NaN; with 4 layers, also its normals."""
    grid_map = _terrain(cells, layers).copy()
    grid_map.timestamp = 1_000_000_000
    return grid_map


def moved_terrain(cells: int) -> GridMap:
    """Return the terrain after a move by 10 rows and 7 columns, with a nonzero start index."""
    grid_map = terrain(cells)
    grid_map.move((-10 * RESOLUTION, -7 * RESOLUTION))
    return grid_map


@cache
def _terrain(cells: int, layers: int) -> GridMap:
    side = cells * RESOLUTION
    grid_map = GridMap((side, side), RESOLUTION, frame_id="map")
    grid_map["elevation"] = np.where(_draws(cells) < 0.05, np.nan, heights(grid_map))
    if layers == 1:
        return grid_map
    normals = NormalVectors(
        input_layer="elevation",
        output_layers_prefix="normal_vectors_",
        normal_vector_positive_axis="z",
    )
    return normals(grid_map)


def heights(grid_map: GridMap) -> np.ndarray:
    """Return the heights (rows, cols) without holes."""
    x, y = grid_map.axes()
    x, y = x[:, None], y[None, :]
    return 0.3 * np.sin(1.3 * x) * np.cos(0.9 * y) + 0.05 * np.sin(7 * x + 3 * y)


def _draws(cells: int) -> np.ndarray:
    """Return one number in [0, 1) per cell from a linear congruential generator, row after row."""
    with np.errstate(over="ignore"):
        factor, offset = np.uint32(MULTIPLIER), np.uint32(INCREMENT)
        states = np.array([SEED], dtype=np.uint32) * factor + offset
        while states.size < cells * cells:
            # `factor` and `offset` advance each state by `states.size` draws.
            states = np.append(states, states * factor + offset)
            factor, offset = factor * factor, offset * factor + offset
    return (states[: cells * cells] >> 8).reshape(cells, cells) / 2.0**24
