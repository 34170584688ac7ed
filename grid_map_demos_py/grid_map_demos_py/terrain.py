# SPDX-License-Identifier: BSD-3-Clause
"""Demo terrain: a real elevation model with holes like those in sensor data."""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap, circle_cells, color_vector_to_value
from grid_map_core_py.files._shared import storage_errors

METRES_PER_POST = 84.0
"""Post spacing of the model [m]: 3 arc seconds at 36.6 degrees latitude, averaged over x and y."""

EXAGGERATION = 2.0  # factor applied to the heights; it makes some slopes too steep for a robot


def load_terrain(
    path: Path, resolution: float = 0.03, *, frame_id: str = "map", holes: bool = True
) -> GridMap:
    """Return the terrain around the Jacksboro fault, scaled down to cells of `resolution` [m].

    The map has 403 x 344 cells and the layers `elevation` (height above the lowest point [m]) and
    `color`. Both are NaN in the round holes. x points east and y points north. Heights are scaled
    down like lengths along x and y, and then multiplied by `EXAGGERATION`.

    `path` is an .npz file with the array `elevation` [m]. Rows run southward, and columns eastward.
    """
    with storage_errors(path, "read"), np.load(path) as model:
        posts: npt.NDArray[np.float32] = model["elevation"].astype(np.float32)
        if posts.ndim != 2 or not posts.size:
            raise ValueError(f"'elevation': expected rows and columns, got the shape {posts.shape}")
    heights = (posts - posts.min()) * np.float32(EXAGGERATION * resolution / METRES_PER_POST)
    # Row indices of the map increase from east to west (-x), column indices from north to south.
    elevation = heights[:, ::-1].T
    grid_map = GridMap(np.multiply(elevation.shape, resolution), resolution, frame_id=frame_id)
    grid_map["elevation"] = elevation
    # Color valleys green and summits white.
    tints = [(0.18, 0.42, 0.24), (0.62, 0.68, 0.38), (0.62, 0.47, 0.32), (0.96, 0.95, 0.94)]
    share = (elevation - elevation.min()) / max(float(np.ptp(elevation)), 1e-9)
    stops = np.linspace(0.0, 1.0, len(tints))
    channels = [np.interp(share, stops, channel) for channel in zip(*tints, strict=True)]
    grid_map["color"] = color_vector_to_value(np.stack(channels, axis=-1))
    # Every call returns the same random holes.
    random = np.random.default_rng(7)
    centers = grid_map.position + random.uniform(-0.5, 0.5, (120, 2)) * grid_map.length
    radii = random.uniform(0.5, 6.0, 120) * grid_map.resolution
    for center, radius in zip(centers, radii, strict=True) if holes else ():
        cells = circle_cells(grid_map, center, radius)
        grid_map["elevation"][cells] = grid_map["color"][cells] = np.nan
    return grid_map
