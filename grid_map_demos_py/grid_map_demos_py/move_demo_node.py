# SPDX-License-Identifier: BSD-3-Clause
"""Node `move_demo`: moves a map along a spiral, alternating between `move` and `position`.

`move` keeps the data in place in the world, and discards data outside the new map borders. Setting
`position` moves the data with the map. The node publishes the map on `grid_map`.
"""

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import Positions

from .demo import Demo


def make_map() -> GridMap:
    """Return a map of 70 x 70 cells with random values from -1 to 1."""
    grid_map = GridMap((0.7, 0.7), 0.01, layers=["layer"], frame_id="map")
    grid_map["layer"] = np.random.default_rng().uniform(-1.0, 1.0, grid_map.size)
    return grid_map


def place(seconds: float) -> Positions:
    """Return the map position (2,) [m] after `seconds` on a spiral from the origin."""
    return 0.03 * seconds * np.array([np.cos(seconds), np.sin(seconds)])


class MoveDemoNode(Demo):
    """Node that moves a map along the spiral and publishes it."""

    def __init__(self) -> None:
        super().__init__("move_demo")
        about = "time for which each method is shown [s]"
        self._duration = self.read_positive("duration", 10.0, about)
        self._original = make_map()
        self._uses_move = False
        self._end = -np.inf
        self.publish_maps(10.0)

    def map_at(self, seconds: float) -> GridMap:
        if seconds > self._end:
            self._uses_move = not self._uses_move
            way = "move" if self._uses_move else "position"
            self.get_logger().info(f"changes the position of the map with `{way}`")
            self._map = self._original.copy()
            self._end = seconds + self._duration
        position = place(seconds - self._end + self._duration)
        if self._uses_move:
            self._map.move(position)
        else:
            self._map.position = position
        return self._map


if __name__ == "__main__":
    raise SystemExit(MoveDemoNode.main())
