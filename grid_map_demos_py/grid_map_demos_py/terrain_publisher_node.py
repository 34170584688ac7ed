# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_terrain`: publishes a map of real terrain, with holes, once a second."""

from grid_map_core_py import GridMap

from .demo import Demo
from .terrain import load_terrain


class TerrainPublisherNode(Demo):
    """Node that publishes a static terrain map, stamped with the current time."""

    def __init__(self) -> None:
        super().__init__("grid_map_terrain")
        topic = self.read_topic("topic", "/grid_map", "topic of the map")
        about = "elevation model (.npz file); if empty, the model of the Jacksboro fault"
        path = self.read_path("file", "", about, data="jacksboro_fault_dem.npz")
        resolution = self.read_positive("resolution", 0.03, "side of a cell [m]")
        frame_id = self.read("frame_id", "map", "coordinate frame of the map")
        self._map = load_terrain(path, resolution, frame_id=frame_id)
        self.publish_maps(1.0, topic)

    def map_at(self, _seconds: float) -> GridMap:
        return self._map


if __name__ == "__main__":
    raise SystemExit(TerrainPublisherNode.main())
