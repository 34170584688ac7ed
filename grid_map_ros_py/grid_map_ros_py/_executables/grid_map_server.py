# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_server`: holds a map, publishes it latched and offers it by services.

Services:
    ~/get_grid_map: `grid_map_msgs/GetGridMap`, returns the map or a part of it.
    ~/get_grid_map_info: `grid_map_msgs/GetGridMapInfo`, returns its size, resolution and place.
    ~/set_grid_map: `grid_map_msgs/SetGridMap`, replaces the map.
    ~/load_map: `grid_map_msgs/ProcessFile`, loads the last map of a bag.
    ~/save_map: `grid_map_msgs/ProcessFile`, saves the map to a bag.

A request that fails is logged and changes nothing. The response is a map without layers and with a
resolution of 0, or `success: false`.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.node import Node

from grid_map_core_py import GridMap
from grid_map_core_py.errors import ConfigError, GridMapError
from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_msgs.srv import GetGridMap, GetGridMapInfo, ProcessFile, SetGridMap

from .._mapping.map_server import MapServer
from ..bags._bag import STORAGES, load_from_bag
from ..messages._grid_map import ReceivedMap, from_message, to_serialized_message
from ..nodes._parameters import check_topic, read_parameter
from ..nodes._qos import map_qos
from ..nodes._spin import run
from ..nodes._subscription import MapSubscription
from ..nodes._throttle import LogThrottle


class GridMapServerNode(Node):
    """Wires services and topics to a `MapServer`."""

    def __init__(self) -> None:
        super().__init__("grid_map_server")
        about = "file format of saved bags: `mcap` or `sqlite3`"
        storage = read_parameter(self, "storage", str, "mcap", description=about)
        check(storage in STORAGES, "storage", f"one of {', '.join(STORAGES)}", storage)
        about = "directory below which requests load and save bags; empty refuses them"
        path = read_parameter(self, "directory", str, "", description=about)
        check(not path or Path(path).is_dir(), "directory", "a directory that exists", path)
        self._server = MapServer(Path(path) if path else None, storage)
        self._throttle = LogThrottle()
        about = "topic of the map, published whenever it changes"
        topic = _read_topic(self, "output_topic", "/grid_map", about)
        self._publisher = self.create_publisher(GridMapMessage, topic, map_qos())
        about = "bag whose last map is loaded at the start; empty means none"
        path = read_parameter(self, "file_path", str, "", description=about)
        about = "topic in that bag; empty means the only topic with maps"
        bag_topic = read_parameter(self, "bag_topic", str, "", description=about)
        if path:
            self._take(load_from_bag(path, bag_topic or None, unwrap=False))
        self._subscribe()
        for kind, name, callback in (
            (GetGridMap, "get_grid_map", self._on_get_grid_map),
            (GetGridMapInfo, "get_grid_map_info", self._on_get_grid_map_info),
            (SetGridMap, "set_grid_map", self._on_set_grid_map),
            (ProcessFile, "load_map", self._on_load_map),
            (ProcessFile, "save_map", self._on_save_map),
        ):
            self.create_service(kind, f"~/{name}", callback)
        self.get_logger().info(f"serves {self._publisher.topic_name}")

    def _subscribe(self) -> None:
        topic = _read_topic(self, "input_topic", "", "topic of maps to serve; empty means none")
        if not topic:
            return
        if self.resolve_topic_name(topic) == self._publisher.topic_name:
            raise ConfigError(f"input_topic and output_topic are both {topic!r}")
        self._subscription = MapSubscription(self, topic, self._on_map)

    def _take(self, grid_map: GridMap) -> None:
        # Serialize first: a map that cannot be published must not replace the last one.
        data = to_serialized_message(grid_map)
        self._server.grid_map = grid_map
        self._publisher.publish(data)

    def _attempt(self, what: str, action: Callable[[], None]) -> bool:
        """Return whether an action succeeds, and log why it does not."""
        try:
            action()
        except GridMapError as error:
            text = f"{what}: {error}"
            if self._throttle.allow(text):
                self.get_logger().error(text)
            return False
        return True

    # --- topics and services ----------------------------------------------------------------------

    def _on_map(self, received: ReceivedMap) -> None:
        self._attempt("dropped a map", lambda: self._take(received.decode(unwrap=False)))

    def _on_get_grid_map(self, request: Any, response: Any) -> Any:
        def get() -> None:
            position = request.position_x, request.position_y
            length = request.length_x, request.length_y
            response.map = self._server.part(request.frame_id, position, length, request.layers)

        self._attempt("get_grid_map", get)
        return response

    def _on_get_grid_map_info(self, _request: Any, response: Any) -> Any:
        def get() -> None:
            response.info = self._server.info()

        self._attempt("get_grid_map_info", get)
        return response

    def _on_set_grid_map(self, request: Any, response: Any) -> Any:
        self._attempt("set_grid_map", lambda: self._take(from_message(request.map, unwrap=False)))
        return response

    def _on_load_map(self, request: Any, response: Any) -> Any:
        def load() -> None:
            self._take(self._server.load(request.file_path, request.topic_name))

        response.success = self._attempt("load_map", load)
        return response

    def _on_save_map(self, request: Any, response: Any) -> Any:
        def save() -> None:
            topic = request.topic_name or self._publisher.topic_name
            self._server.save(request.file_path, topic)

        response.success = self._attempt("save_map", save)
        return response


def _read_topic(node: Node, name: str, default: str, description: str) -> str:
    topic = read_parameter(node, name, str, default, description=description)
    return check_topic(node, name, topic) if topic or default else ""


def main() -> int:
    """Run the node until an interrupt or a shutdown; return the exit code."""
    return run(GridMapServerNode)


if __name__ == "__main__":
    sys.exit(main())
