# SPDX-License-Identifier: BSD-3-Clause
"""Node `grid_map_saver`: saves maps from a topic to a bag."""

from rclpy.utilities import try_shutdown

from grid_map_core_py.errors import GridMapError

from .. import BagWriter, MessageError, ReceivedMap
from ..bags._bag import chosen_storage
from ..errors import NodeFailedError
from ..nodes import ConfiguredNode, MapSubscription, read_parameter
from ..nodes._spin import steady_timer

LOG_PERIOD = 10.0
"""Time between two log messages about saved maps [s]."""


class GridMapSaverNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__("grid_map_saver")
        about = "folder of the bag; an existing bag is replaced"
        self._path = read_parameter(self, "file_path", str, description=about)
        topic = self.read_topic("grid_map_topic", "/grid_map", "topic of grid maps")
        bag_topic = self.read("bag_topic", "", "topic in the bag; empty means `grid_map_topic`")
        self._topic = bag_topic or self.resolve_topic_name(topic)
        about = "keep running; each new map replaces the saved map"
        self._continuous = self.read("continuous", False, about)
        about = "file format: `auto`, `mcap` or `sqlite3`; C++ `loadFromBag` reads only `sqlite3`"
        storage = self.read("storage", "auto", about)
        self._storage = chosen_storage(storage, self.get_logger().warning)
        about = "compression of the bag: `none`, `lz4` or `zstd`; the last two require `mcap`"
        self._compression = self.read("compression", "none", about)
        # Fail now rather than when the first map arrives.
        self._bag().check(self._topic)
        self._saved, self._logged = 0, 1
        steady_timer(self, LOG_PERIOD, self._log_count)
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
        self._saved += 1
        if self._saved == 1:
            self.get_logger().info(f"saved {grid_map}")
        if not self._continuous:
            try_shutdown()

    def _log_count(self) -> None:
        if self._saved > self._logged:
            self.get_logger().info(f"more maps saved: {self._saved - self._logged}")
            self._logged = self._saved


if __name__ == "__main__":
    raise SystemExit(GridMapSaverNode.main())
