# SPDX-License-Identifier: BSD-3-Clause
"""Node `octomap_to_grid_map`: publishes the surface of an OctoMap as a map."""

import math
from typing import Any

from grid_map_core_py.plugins import check
from grid_map_msgs.msg import GridMap as GridMapMessage

from .. import from_octomap, to_serialized_message
from ..messages._octomap import LARGEST_VOXEL
from ..messages._packages import messages_of
from ..nodes import ConfiguredNode, map_qos
from ..nodes._health import LogThrottle, dropping, health_of
from ..nodes._spin import steady_timer
from ..nodes._topics import LatchedSubscription

NAME = "octomap_to_grid_map"


class OctomapToGridMapNode(ConfiguredNode):
    def __init__(self) -> None:
        super().__init__(NAME)
        self._log = LogThrottle(self.get_logger())
        topic = self.read_topic("grid_map_topic", "/grid_map", "topic of the map")
        self._layer = self.read("layer", "elevation", "name of the height layer")
        about = "cell size [m]; 0 means the voxel size"
        self._resolution = self.read_number("resolution", 0.0, 0.0, LARGEST_VOXEL, about) or None
        self._min_bound = self._read_bound("min", "smaller")
        self._max_bound = self._read_bound("max", "larger")
        for axis, low, high in zip("xyz", self._min_bound, self._max_bound, strict=True):
            check(not low > high, f"max_{axis}", f"at least min_{axis}, {low:g}", high)
        self._publisher = self.create_publisher(GridMapMessage, topic, map_qos())
        source = self._listen()
        self.get_logger().info(
            f"publishes the octomaps of {source} on {self._publisher.topic_name}"
        )

    def _read_bound(self, end: str, beyond: str) -> list[float]:
        about = f"voxels with {beyond} {{0}} [m] are ignored; `.nan` means no bound"
        return [self.read(f"{end}_{axis}", math.nan, about.format(axis)) for axis in "xyz"]

    def _listen(self) -> str:
        """Subscribe to the topic or poll the service, and return its name."""
        about = "topic of the octomaps, binary or full"
        topic = self.read_topic("octomap_topic", "/octomap_binary", about)
        about = "`octomap_msgs/GetOctomap` service to use instead of the topic; empty means none"
        service = self.read_topic("octomap_service_topic", "", about)
        about = "time between two service calls [s]"
        self._period = self.read_positive("octomap_service_period", 10.0, about)
        if not service:
            octomap = messages_of("octomap_msgs", NAME).Octomap
            self._subscription = LatchedSubscription(self, octomap, topic, self._publish)
            return self._subscription.topic_name
        self._service = messages_of("octomap_msgs", NAME, "srv").GetOctomap
        self._client = self.create_client(self._service, service)
        self._answer: Any = None
        # The service may start after the node.
        self._timer = steady_timer(self, min(1.0, self._period), self._ask)
        return str(self._client.srv_name)

    def _ask(self) -> None:
        if not self._client.service_is_ready():
            self._log.warning(f"the service {self._client.srv_name} is not there")
            return
        self._timer.timer_period_ns = int(1e9 * self._period)
        self._timer.reset()
        if self._answer is None or self._answer.done():
            self._answer = self._client.call_async(self._service.Request())
            self._answer.add_done_callback(self._receive)

    def _receive(self, answer: Any) -> None:
        with dropping(self._log, "cannot use the octomap"), health_of(self).counted():
            self._publish(answer.result().map)

    def _publish(self, octomap: Any) -> None:
        grid_map = from_octomap(
            octomap,
            self._layer,
            self._resolution,
            min_bound=self._min_bound,
            max_bound=self._max_bound,
        )
        grid_map.basic_layers = [self._layer]
        self._publisher.publish(to_serialized_message(grid_map))


if __name__ == "__main__":
    raise SystemExit(OctomapToGridMapNode.main())
