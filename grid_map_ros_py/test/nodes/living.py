# SPDX-License-Identifier: BSD-3-Clause
"""A node whose behavior is the first argument: `idle`, `busy`, `stuck`, ..."""

import atexit
import os
import signal
import sys
import time

from rclpy.node import Node
from std_msgs.msg import Empty

from grid_map_core_py import GridMapError
from grid_map_ros_py.errors import NodeFailedError
from grid_map_ros_py.nodes import read_parameter, run

HABIT = sys.argv[1]
TOPIC = "no topic" if HABIT == "misnamed" else "/beat"


class Living(Node):
    def __init__(self) -> None:
        super().__init__("being")
        self.delay = read_parameter(self, "delay", float, 0.0)
        if HABIT == "misconfigured":
            raise GridMapError("filter 3 'smooth': unknown parameter 'radiu'")
        if HABIT == "buggy":
            raise ZeroDivisionError("a bug")
        if HABIT == "importing":
            self.interrupt_import()
        self.is_silent = True
        self.publisher = self.create_publisher(Empty, TOPIC, 1)
        if HABIT == "slow":
            print("alive", flush=True)
            self.dawdle()
        self.timer = self.create_timer(self.delay, self.live)

    def live(self) -> None:
        """Print "alive" once; a busy node publishes all the time, a stuck one never returns."""
        self.publisher.publish(Empty())
        if HABIT != "busy":
            self.timer.cancel()
        if self.is_silent:
            print("alive", flush=True)
            self.is_silent = False
        if HABIT == "gives up":
            raise NodeFailedError("the battery is empty")
        if HABIT == "buggy while it lives":
            raise GridMapError("a bug")
        while HABIT == "stuck":
            time.sleep(0.1)

    def interrupt_import(self) -> None:
        """Act as a compiled module whose import gets two signals: fail, and crash at the end."""
        atexit.register(os.abort)
        try:
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt as interrupt:
            raise ImportError("initialization failed") from interrupt

    def dawdle(self) -> None:
        deadline = time.monotonic() + 1
        while time.monotonic() < deadline:
            self.destroy_publisher(self.create_publisher(Empty, "/other", 1))

    def destroy_node(self) -> None:
        super().destroy_node()
        print("destroyed", flush=True)


if __name__ == "__main__":
    sys.exit(run(Living, sys.argv))
