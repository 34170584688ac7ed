# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""A node that ends before it is created, or lives until it is stopped: see its first argument."""

import sys
import time

from rclpy.node import Node
from std_msgs.msg import Empty

from grid_map_core_py import GridMapError
from grid_map_ros_py.spin import run

HABIT = sys.argv[1]


class Living(Node):
    def __init__(self) -> None:
        super().__init__("living")
        if HABIT == "misconfigured":
            raise GridMapError("filter 3 'smooth': unknown parameter 'radiu'")
        if HABIT == "buggy":
            raise ZeroDivisionError("a bug")
        self.publisher = self.create_publisher(Empty, "/beat", 1)
        if HABIT == "slow":
            print("alive", flush=True)
            self.dawdle()
        self.timer = self.create_timer(0.0, self.live)

    def live(self) -> None:
        """Say so once; a busy node publishes until it is too late."""
        self.timer.cancel()
        print("alive", flush=True)
        while HABIT == "busy":
            self.publisher.publish(Empty())

    def dawdle(self) -> None:
        deadline = time.monotonic() + 1
        while time.monotonic() < deadline:
            self.destroy_publisher(self.create_publisher(Empty, "/other", 1))

    def destroy_node(self) -> None:
        super().destroy_node()
        print("destroyed", flush=True)


if __name__ == "__main__":
    sys.exit(run(Living, sys.argv))
