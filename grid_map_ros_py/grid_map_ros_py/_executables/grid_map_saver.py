# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_saver`: saves the map of a topic to a bag."""

from rclpy.node import Node
from rclpy.utilities import try_shutdown

from grid_map_core_py.errors import GridMapError

from .. import BagWriter, MessageError, ReceivedMap
from ..errors import NodeFailedError
from ..nodes import MapSubscription, read_parameter, read_topic, run


class GridMapSaverNode(Node):
    """Saves the first map that it receives, or every map."""

    def __init__(self) -> None:
        super().__init__("grid_map_saver")
        about = "folder of the bag; an existing bag is replaced"
        self._path = read_parameter(self, "file_path", str, description=about)
        topic = read_topic(self, "grid_map_topic", "/grid_map", description="topic of the maps")
        about = "topic in the bag; empty means `grid_map_topic`"
        bag_topic = read_parameter(self, "bag_topic", str, "", description=about)
        self._topic = bag_topic or self.resolve_topic_name(topic)
        about = "save every map, each replacing the last one, instead of ending after the first"
        self._continuous = read_parameter(self, "continuous", bool, False, description=about)
        about = "file format of the bag: `mcap` or `sqlite3`, which `loadFromBag` in C++ reads"
        self._storage = read_parameter(self, "storage", str, "mcap", description=about)
        about = "compression of the bag: `none`, or with `mcap` also `lz4` or `zstd`"
        self._compression = read_parameter(self, "compression", str, "none", description=about)
        # Fail now rather than when the first map arrives.
        self._bag().check(self._topic)
        self._subscription = MapSubscription(self, topic, self._on_map)
        self.get_logger().info(f"saves maps of {self._subscription.topic_name} to {self._path}")

    def _bag(self) -> BagWriter:
        return BagWriter(self._path, storage=self._storage, compression=self._compression)

    def _on_map(self, received: ReceivedMap) -> None:
        grid_map = received.decode(unwrap=False)
        try:
            with self._bag() as bag:
                bag.write(self._topic, grid_map)
        except GridMapError as error:
            if self._continuous or isinstance(error, MessageError):
                raise
            raise NodeFailedError(str(error)) from error
        self.get_logger().info(f"saved {grid_map}")
        if not self._continuous:
            try_shutdown()


def main() -> int:
    """Run the node until an interrupt, or until it has saved a map; return the exit code."""
    return run(GridMapSaverNode)


if __name__ == "__main__":
    raise SystemExit(main())
