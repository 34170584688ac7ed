# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_server`: stores a map, publishes it on a latched topic and serves it on request.

Services:
    ~/get_grid_map: `grid_map_msgs/GetGridMap`, returns the map or a part of it.
    ~/get_grid_map_info: `grid_map_msgs/GetGridMapInfo`, returns map size, resolution and position.
    ~/set_grid_map: `grid_map_msgs/SetGridMap`, replaces the map.
    ~/load_map: `grid_map_msgs/ProcessFile`, loads the last map of a bag.
    ~/save_map: `grid_map_msgs/ProcessFile`, saves the map to a bag.

If the parameter `source` is set, the node serves a map of any size: it reads only the requested
part for each response. The map is not published, and requests cannot replace it.

A failed request is logged and changes nothing. Its response contains `success: false`, or a map
with resolution 0 and no layers.
"""

from pathlib import Path
from typing import Any

from grid_map_core_py import GridMap
from grid_map_core_py.errors import ConfigError
from grid_map_core_py.plugins import check
from grid_map_core_py.tiled import TiledMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_msgs.srv import GetGridMap, GetGridMapInfo, ProcessFile, SetGridMap

from .. import from_message, load_from_bag, save_to_bag, to_message, to_serialized_message
from .._serving import part, place_below, read_source
from ..bags._bag import STORAGES, chosen_storage
from ..errors import RequestError
from ..messages._grid_map import to_info
from ..nodes import ConfiguredNode, MapSubscription, map_qos
from ..nodes._health import LogThrottle
from ..nodes._topics import offer_service


class GridMapServerNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__("grid_map_server")
        self._log = LogThrottle(self.get_logger())
        about = "file format of saved bags: `mcap`, `sqlite3` or `auto`"
        storage = self.read_choice("storage", ("auto", *STORAGES), "auto", about)
        about = "directory in which requests load and save bags; empty disables these requests"
        self._directory = path = self.read("directory", "", about)
        check(not path or Path(path).is_dir(), "directory", "a directory that exists", path)
        self._storage = chosen_storage(storage, self.get_logger().warning) if path else storage
        about = "topic of the map, published whenever it changes"
        topic = self.read_topic("output_topic", "/grid_map", about)
        self._topic = self.resolve_topic_name(topic)
        about = "bag whose last map is loaded at startup; empty means none"
        path = self.read("file_path", "", about)
        about = "topic in the bag; empty means the only topic with maps"
        bag_topic = self.read("bag_topic", "", about)
        topic = self.read_topic("input_topic", "", "topic of grid maps to serve; empty means none")
        open_source = read_source(self, "empty means none")
        self._map: GridMap | TiledMap | None = open_source() if open_source else None
        if self._map is None:
            self._publisher = self.create_publisher(GridMapMessage, self._topic, map_qos())
        else:
            for name, value in (("file_path", path), ("input_topic", topic)):
                check(not value, name, "nothing beside a source", value)
        if path:
            self._take(load_from_bag(path, bag_topic or None, unwrap=False))
        if topic:
            if self.resolve_topic_name(topic) == self._topic:
                raise ConfigError(f"input_topic and output_topic are both {topic!r}")
            self._subscription = MapSubscription(
                self, topic, lambda received: self._take(received.decode(unwrap=False))
            )
        for kind, action in (
            (GetGridMap, self.get_grid_map),
            (GetGridMapInfo, self.get_grid_map_info),
            (SetGridMap, self.set_grid_map),
            (ProcessFile, self.load_map),
            (ProcessFile, self.save_map),
        ):
            offer_service(self, kind, action.__name__, action, self._log)
        served = self._topic
        if isinstance(self._map, TiledMap):
            rows, columns = self._map.size
            served = f"parts of {rows} x {columns} cells in the frame {self._map.frame_id!r}"
        self.get_logger().info(f"serves {served}")

    def _take(self, grid_map: GridMap) -> None:
        if isinstance(self._map, TiledMap):
            raise RequestError("the map is fixed by the parameter 'source'")
        # Publish first: a map that cannot be published must not replace the current map.
        self._publisher.publish(to_serialized_message(grid_map))
        self._map = grid_map

    def _held_map(self) -> GridMap | TiledMap:
        if self._map is None:
            raise RequestError("there is no map yet")
        return self._map

    # --- services ---------------------------------------------------------------------------------

    def get_grid_map(self, request: Any, response: Any) -> None:
        position = request.position_x, request.position_y
        length = request.length_x, request.length_y
        layers = request.layers or None
        found = part(self._held_map(), request.frame_id, position, length, layers)
        response.map = to_message(found, layers)

    def get_grid_map_info(self, _request: Any, response: Any) -> None:
        response.info = to_info(self._held_map().geometry)

    def set_grid_map(self, request: Any, _response: Any) -> None:
        self._take(from_message(request.map, unwrap=False))

    def load_map(self, request: Any, response: Any) -> None:
        with place_below(self._directory, request.file_path) as path:
            self._take(load_from_bag(path, request.topic_name or None, unwrap=False))
        response.success = True

    def save_map(self, request: Any, response: Any) -> None:
        held, topic = self._held_map(), request.topic_name or self._topic
        grid_map = held.to_map() if isinstance(held, TiledMap) else held
        with place_below(self._directory, request.file_path) as path:
            save_to_bag(grid_map, path, topic, storage=self._storage)
        response.success = True


if __name__ == "__main__":
    raise SystemExit(GridMapServerNode.main())
