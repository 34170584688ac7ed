# SPDX-License-Identifier: BSD-3-Clause
"""Send or receive large maps, or send clouds, and print the results; see the last line."""

import array
import json
import re
import sys
from pathlib import Path

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import ReceivedMap, to_serialized_message
from grid_map_ros_py.nodes import MapSubscription, map_qos, run

COUNT = 5
CLOUDS = 30
SIDE = 1000
LAYERS = [f"layer_{k}" for k in range(9)]
QOS = map_qos()
QOS.depth = COUNT


class Sender(Node):
    """Sends all maps at once, when it has a subscriber."""

    def __init__(self) -> None:
        super().__init__("sender")
        self._publisher = self.create_publisher(GridMapMessage, "/large_map", QOS)
        self.create_timer(0.05, self._send)
        self._is_done = False

    def _send(self) -> None:
        if self._is_done or not self._publisher.get_subscription_count():
            return
        for number in range(COUNT):
            values = np.full((SIDE, SIDE), number, np.float32)
            grid_map = GridMap((SIDE, SIDE), 1.0, layers=dict.fromkeys(LAYERS, values))
            grid_map.timestamp = number
            self._publisher.publish(to_serialized_message(grid_map))
        self._is_done = True
        print(json.dumps({"largest segment": largest_segment()}), flush=True)


class CloudSender(Node):
    """Sends clouds as a sensor does: 1.2 MB, best effort, ten times a second."""

    def __init__(self) -> None:
        super().__init__("sensor")
        qos = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._publisher = self.create_publisher(PointCloud2, "/points", qos)
        self._cloud = PointCloud2(data=array.array("B", bytes(1_200_000)))
        self._left = CLOUDS
        self.create_timer(0.1, self._send)

    def _send(self) -> None:
        if self._left and self._publisher.get_subscription_count():
            self._publisher.publish(self._cloud)
            self._left -= 1
            if not self._left:
                print(f"sent {CLOUDS}", flush=True)


class Receiver(Node):
    """Checks one layer of every map."""

    def __init__(self) -> None:
        super().__init__("receiver")
        self._maps = MapSubscription(self, "/large_map", self._receive, qos=QOS)

    def _receive(self, received: ReceivedMap) -> None:
        layer = received.decode(LAYERS[-1:])[LAYERS[-1]]
        assert (layer == received.timestamp).all()
        print(json.dumps([received.timestamp, len(received.layers), *layer.shape]), flush=True)


def largest_segment() -> int:
    """Return the size of this process's largest shared memory segment [bytes]."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    ranges = [re.match(r"(\w+)-(\w+) ", line) for line in lines if "/dev/shm/fastrtps" in line]
    return max((int(found[2], 16) - int(found[1], 16) for found in ranges if found), default=0)


if __name__ == "__main__":
    sys.exit(run({"send": Sender, "send clouds": CloudSender, "receive": Receiver}[sys.argv[1]]))
