# SPDX-License-Identifier: BSD-3-Clause
"""Path of a robot, and a tiled map of 10^9 cells with heights only near the path."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.tiled import TiledMap

GEOMETRY = GridGeometry.from_size((32768, 32768), 0.1)
"""Map of 3.3 km x 3.3 km around the origin; each layer has 1.07e9 cells (4.3 GB)."""

LAYER = "elevation"

CORRIDOR = 30.0  # heights are known up to this distance from the path, measured along y [m]
BEND, WAVE = 300.0, 2000.0  # amplitude and wavelength of the path [m]
END = 1500.0  # the path leads from x = END to x = -END [m]
_TILE = 1024  # side length of a chunk [cells]
_LENGTHS = np.geomspace(1.5, 400.0, 24)  # wavelengths of the waves that form the ground [m]


def way_at(x: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return the y coordinate [m] of the path at x [m]."""
    return BEND * np.sin(2 * math.pi / WAVE * np.asarray(x, np.float64))


def ground(geometry: GridGeometry) -> npt.NDArray[np.float32]:
    """Return the ground heights (rows, cols) [m] at the cells of a grid.

    The ground is a sum of waves in random directions. Longer waves are higher.
    """
    # A wave is a sum of two products f(x) g(y), so one matrix product yields all heights.
    random = np.random.default_rng(5)
    angles = random.uniform(0, 2 * math.pi, _LENGTHS.size)
    phases = random.uniform(0, 2 * math.pi, _LENGTHS.size)
    number = 2 * math.pi / _LENGTHS
    x, y = geometry.axes_in_map_order()
    along = np.outer(x, number * np.cos(angles)) + phases
    across = np.outer(number * np.sin(angles), y)
    height = 0.015 * _LENGTHS**0.9
    left = np.hstack([height * np.sin(along), height * np.cos(along)])
    right = np.vstack([np.cos(across), np.sin(across)])
    return left.astype(np.float32) @ right.astype(np.float32)


def make_site(path: Path) -> Iterator[None]:
    """Write the chunks near the path to a Zarr store, and yield after each chunk."""
    site = TiledMap.create(path, GEOMETRY, [LAYER], chunks=_TILE)
    for rows, columns in site.tiles:
        geometry = site.geometry.cropped(rows, columns)
        x, y = geometry.axes_in_map_order()
        middle = way_at(x)
        # Checking all cells of the many chunks far from the path would take longer than writing the
        # others.
        if max(np.abs(x).min() - END, middle.min() - y[0], y[-1] - middle.max()) > CORRIDOR:
            continue
        is_known = np.abs(y - middle[:, None]) <= CORRIDOR
        heights = np.where(is_known, ground(geometry), np.float32(np.nan))
        site.write(GridMap.from_geometry(geometry, frame_id="map", layers={LAYER: heights}))
        yield
