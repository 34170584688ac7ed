# SPDX-License-Identifier: BSD-3-Clause
"""Node `octomap_to_gridmap_demo`: converts an octomap to an elevation map.

The demo requests an octomap every 10 s from a node such as octomap_server, or reads an octomap from
a file. It publishes `grid_map` with the height of the highest occupied voxel in each cell. It
republishes a requested octomap on `octomap` for RViz.
"""

import math
from typing import Any

from grid_map_core_py import GridMap
from grid_map_core_py._packages import remedy_for
from grid_map_core_py.errors import required
from grid_map_core_py.plugins import check
from grid_map_ros_py import from_octomap, load_octomap, to_serialized_message
from grid_map_ros_py.errors import DROPPED, reason
from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.nodes._spin import steady_timer

from .demo import Demo

PERIOD = 10.0  # time between two requests [s]
PATIENCE = 1.0  # time between two checks while the service is not available [s]

REMEDY = f"{remedy_for('octomap_msgs.msg')}, or name a file by 'octomap_path'"


class OctomapToGridmapDemoNode(Demo):
    """Node that converts an octomap from a service or a file to a map."""

    def __init__(self) -> None:
        super().__init__("octomap_to_gridmap_demo")
        about = "service that returns an octomap"
        service = self.read_topic("octomap_service_topic", "/octomap_binary", about)
        about = "OctoMap file (.bt, .ot) to read instead of calling the service"
        path = self.read_path("octomap_path", "", about)
        about = "{} of voxels [m]; nan means no bound"
        self._low, self._high = [0.0] * 3, [0.0] * 3
        for k, axis in enumerate("xyz"):
            low = self.read(f"min_{axis}", math.nan, about.format(f"minimum {axis}"))
            high = self.read(f"max_{axis}", math.nan, about.format(f"maximum {axis}"))
            check(not low > high, f"max_{axis}", f"no less than min_{axis}, {low}", high)
            self._low[k], self._high[k] = low, high
        self._publisher = self.map_publisher()
        if path.name:
            grid_map = load_octomap(path, min_bound=self._low, max_bound=self._high)
            grid_map.timestamp = self.get_clock().now().nanoseconds
            self._publish(grid_map)
            return
        messages = required("octomap_msgs.msg", "octomap_to_gridmap_demo", REMEDY)
        kind = required("octomap_msgs.srv", "octomap_to_gridmap_demo", REMEDY).GetOctomap
        self._request = kind.Request()
        self._octomap_publisher = self.create_publisher(messages.Octomap, "octomap", map_qos())
        self._client = self.create_client(kind, service)
        self._timer = steady_timer(self, PATIENCE, self._ask)

    def _publish(self, grid_map: GridMap) -> None:
        grid_map.basic_layers = ["elevation"]
        self._publisher.publish(to_serialized_message(grid_map))
        self.get_logger().info(f"published {grid_map}")

    def _ask(self) -> None:
        is_there = self._client.service_is_ready()
        self._timer.timer_period_ns = int(1e9 * (PERIOD if is_there else PATIENCE))
        self._timer.reset()
        if is_there:
            self._client.call_async(self._request).add_done_callback(self._receive)
        else:
            self.get_logger().info(f"waiting for the service {self._client.srv_name}")

    def _receive(self, answer: Any) -> None:
        octomap = answer.result().map
        try:
            self._publish(
                from_octomap(octomap, "elevation", min_bound=self._low, max_bound=self._high)
            )
        except DROPPED as error:
            self.get_logger().warning(f"cannot use the octomap: {reason(error)}")
        else:
            self._octomap_publisher.publish(octomap)


if __name__ == "__main__":
    raise SystemExit(OctomapToGridmapDemoNode.main())
