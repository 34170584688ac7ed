# SPDX-License-Identifier: BSD-3-Clause
"""The program `grid-map`, and a map for it."""

from pathlib import Path

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.testing import moved_in_buffer

PROGRAM = Path(__file__).parents[1] / "scripts" / "grid-map"

SECOND = 1_000_000_000


def a_map(second: int = 3, layer: str = "elevation") -> GridMap:
    """Return a map that has moved, with a hole, an infinity and colors."""
    options = {"position": (1.0, 2.0), "frame_id": "odom", "timestamp": second * SECOND}
    made = GridMap((0.8, 0.6), 0.1, layers=(layer, "variance", "color"), **options)
    x, y = made.axes()
    made[layer] = second * (x[:, None] - 0.5 * y)
    made[layer][2, 3:5] = np.nan
    made["variance"] = 0.25
    made["variance"][0, 0] = np.inf
    made["color"] = np.array(0x00FF8000, np.uint32).view(np.float32)
    made.basic_layers = [layer]
    return moved_in_buffer(made, (3, 1))
