# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Measure the number, delay and cost of maps that reach a callback in another process.

    python3 benchmarks/receive.py [--seconds 10]

Publishes maps of 8 layers, 400 x 400 cells at 30 Hz and 1000 x 1000 cells at 5 Hz, from one process
to another, and prints a table: with the transports that Fast DDS has by itself, with those of
FASTDDS_BUILTIN_TRANSPORTS=LARGE_DATA and with our profile; decoded from messages, from raw bytes,
and one layer from raw bytes. With `--best-effort` the topic is best effort, as of sensors and of
`ros2 topic hz`. Start it where the workspace is set up (`. tools/env.sh`).
"""

import argparse
import json
import resource
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

import grid_map_ros_py
from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, from_serialized_message, to_serialized_message
from grid_map_ros_py.nodes import map_qos, run
from grid_map_ros_py.testing import Process, running, wait_until

TOPIC = "/large_map"
LAYERS = [f"layer_{k}" for k in range(8)]
LOADS = [(400, 30.0), (1000, 5.0)]
"""Cells along a side and maps per second."""

PROFILE = Path(grid_map_ros_py.__file__).with_name("fastdds_large_maps.xml")
TRANSPORTS = {
    "default": {"FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"},
    "LARGE_DATA": {"FASTDDS_BUILTIN_TRANSPORTS": "LARGE_DATA"},
    "profile": {"FASTRTPS_DEFAULT_PROFILES_FILE": str(PROFILE)},
}
RECEIVERS = ["message", "raw", "raw, 1 layer"]


def qos(depth: int) -> QoSProfile:
    """Return the quality of service of maps; a negative depth means best effort."""
    if depth < 0:
        return QoSProfile(depth=-depth, reliability=ReliabilityPolicy.BEST_EFFORT)
    profile = map_qos()
    profile.depth = depth
    return profile


class Publisher(Node):
    """Publishes maps when it has a subscriber; their timestamps are the time of publishing."""

    def __init__(self, cells: int, rate: float, count: int, depth: int) -> None:
        super().__init__("publisher")
        values = np.random.default_rng(0).random((cells, cells), np.float32)
        self._map = GridMap((cells, cells), 1.0, layers=dict.fromkeys(LAYERS, values))
        self._publisher = self.create_publisher(GridMapMessage, TOPIC, qos(depth))
        self._left = count
        self._cpu = 0.0
        self.create_timer(1 / rate, self._publish)

    def _publish(self) -> None:
        if not self._publisher.get_subscription_count() or not self._left:
            return
        self._cpu = self._cpu or cpu_seconds()
        self._map.timestamp = time.time_ns()
        self._publisher.publish(to_serialized_message(self._map))
        self._left -= 1
        if not self._left:
            print(json.dumps({"cpu": cpu_seconds() - self._cpu}), flush=True)


class Subscriber(Node):
    """Decodes maps; prints the number and the delays of the maps so far after each one."""

    def __init__(self, receiver: str, depth: int, count: int) -> None:
        super().__init__("subscriber")
        self._count = count
        self._latencies: list[float] = []
        self._cpu = 0.0
        decode = {
            "message": from_message,
            "raw": from_serialized_message,
            "raw, 1 layer": lambda data: from_serialized_message(data, LAYERS[:1]),
        }[receiver]
        self.create_subscription(
            GridMapMessage,
            TOPIC,
            lambda message: self._receive(decode(message)),
            qos(depth),
            raw=receiver != "message",
        )

    def _receive(self, grid_map: GridMap) -> None:
        self._cpu = self._cpu or cpu_seconds()
        assert np.isfinite(grid_map[LAYERS[0]][0, 0])
        self._latencies.append(1e-6 * (time.time_ns() - grid_map.timestamp))
        late = np.array(self._latencies)
        report = {
            "received": len(late),
            "median": float(np.median(late)),
            "worst": float(late.max()),
            "cpu": cpu_seconds() - self._cpu,
        }
        print(json.dumps(report), flush=True)


def cpu_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def measure(
    cells: int, rate: float, transport: str, receiver: str, seconds: float, depth: int
) -> dict[str, float]:
    """Return the statistics of a subscriber that listens for a number of seconds."""
    count = max(int(rate * seconds), 2)
    with (
        running(_process(transport, "subscribe", receiver, depth, count)) as subscriber,
        running(_process(transport, "publish", cells, rate, count, depth)) as publisher,
    ):
        wait_until(lambda: publisher.lines, "the last map", timeout=10 * seconds + 30)
        _settle(subscriber)
        sent, got = json.loads(publisher.lines[-1]), json.loads(subscriber.lines[-1])
    duration = count / rate
    return {
        "sent": count,
        "lost": count - got["received"],
        "median ms": got["median"],
        "worst ms": got["worst"],
        "publisher CPU %": 100 * sent["cpu"] / duration,
        "subscriber CPU %": 100 * got["cpu"] / duration,
    }


def _process(transport: str, *arguments: object) -> Process:
    command = [sys.executable, __file__, *map(str, arguments)]
    return Process(command, TRANSPORTS[transport])


def _settle(process: Process) -> None:
    """Wait until no map has arrived for a second."""
    before = -1
    while before != len(process.lines) or not process.lines:
        before = len(process.lines)
        time.sleep(1.0)


def rows(seconds: float, depth: int) -> Iterator[tuple[list[str], dict[str, float]]]:
    for cells, rate in LOADS:
        for transport in TRANSPORTS:
            for receiver in RECEIVERS:
                heading = [f"{cells} x {cells}", f"{rate:g} Hz", transport, receiver]
                yield heading, measure(cells, rate, transport, receiver, seconds, depth)


def main() -> int:
    if sys.argv[1:2] == ["publish"]:
        cells, rate, count, depth = sys.argv[2:]
        return run(lambda: Publisher(int(cells), float(rate), int(count), int(depth)), [])
    if sys.argv[1:2] == ["subscribe"]:
        receiver, depth, count = sys.argv[2:]
        return run(lambda: Subscriber(receiver, int(depth), int(count)), [])
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--depth", type=int, default=1)
    parser.add_argument("--best-effort", action="store_true")
    options = parser.parse_args()
    depth = -options.depth if options.best_effort else options.depth
    for heading, values in rows(options.seconds, depth):
        cells = [f"{name} {value:.0f}" for name, value in values.items()]
        print(" | ".join(heading + cells), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
