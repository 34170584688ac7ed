# SPDX-License-Identifier: BSD-3-Clause
"""Executable `snapshot`: saves a picture of the next map on a topic.

See `grid-map plot` for the picture options. The exit code is 0 after success or Ctrl-C.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from grid_map_core_py._commands import UsageError
from grid_map_core_py.plugins import check
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.errors import DROPPED, NodeFailedError, reason
from grid_map_ros_py.nodes import MapSubscription, run
from grid_map_ros_py.nodes._parameters import check_topic, read_limits
from grid_map_ros_py.nodes._spin import steady_timer

from .._commands.plot import add_style, check_style, draw


class SnapshotNode(Node):
    """Node that draws the next map or, if the topic is latched, the last published map."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__("grid_map_snapshot")
        read_limits(self)
        self._options = options
        topic = check_topic(self, "--topic", options.topic)
        self._topic = self.resolve_topic_name(topic)
        # ROS timers count nanoseconds in 64 bits.
        is_time = 0 < options.timeout <= 1e9
        check(is_time, "--timeout", "a positive time up to 1e+09 s", options.timeout)
        self._subscription = MapSubscription(self, topic, self._receive)

        def give_up() -> None:
            raise NodeFailedError(f"no map on {self._topic} within {options.timeout:g} s")

        steady_timer(self, options.timeout, give_up)

    def _receive(self, received: ReceivedMap) -> None:
        if not self.context.ok():
            return
        try:
            draw(received.decode(), self._options, self._options.out)
        except DROPPED as error:
            raise NodeFailedError(f"{self._topic}: {reason(error)}") from error
        print(self._options.out, flush=True)
        self.context.try_shutdown()


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse the command line; an invalid command line ends the process with exit code 2."""
    parser = argparse.ArgumentParser(
        prog="snapshot",
        description="Draw the next map of a topic. For maps in files, use 'grid-map plot'.",
    )
    parser.add_argument("--topic", default="/grid_map", help="topic of grid maps (%(default)s)")
    text = "maximum time to wait for a map [s] (10)"
    parser.add_argument("--timeout", type=float, default=10.0, help=text)
    text = "file to write (%(default)s)"
    parser.add_argument("--out", type=Path, default=Path("snapshot.png"), help=text)
    add_style(parser)
    options = parser.parse_args(arguments)
    try:
        check_style(options, options.out)
    except UsageError as error:
        parser.error(str(error))
    return options


def main() -> int:
    options = parsed(remove_ros_args(sys.argv)[1:])
    return run(lambda: SnapshotNode(options))


if __name__ == "__main__":
    raise SystemExit(main())
