# SPDX-License-Identifier: BSD-3-Clause
"""A map larger than a window, in a Zarr store and as a whole in memory."""

from pathlib import Path

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.tiled import TiledMap

CHUNK = 64
"""Side of the chunks of the store [cells]."""


def make_site(path: Path) -> GridMap:
    """Write a store of 401 x 253 cells with holes, and return its map."""
    random = np.random.default_rng(3)
    grid_map = GridMap((40.1, 25.3), 0.1, (100.0, -50.0), frame_id="map")
    for name in ("elevation", "variance"):
        layer = random.random(grid_map.size, np.float32)
        layer[random.random(grid_map.size) < 0.1] = np.nan
        grid_map[name] = layer
    grid_map.basic_layers = basic = ["elevation"]
    site = TiledMap.create(path, grid_map.geometry, grid_map, chunks=CHUNK, basic_layers=basic)
    site.write(grid_map)
    return grid_map
