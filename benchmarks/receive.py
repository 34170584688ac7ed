# SPDX-License-Identifier: BSD-3-Clause
"""Measure the number, delay and cost of maps that reach a callback in another process.

    python3 benchmarks/receive.py [--seconds 10]
    python3 benchmarks/receive.py --filtered [--seconds 10]
    python3 benchmarks/receive.py --requests 300

The first command publishes 8-layer maps of 400 x 400 cells at 30 Hz and 1000 x 1000 cells at 5 Hz
from one process to another. It prints a table for three transports (the Fast DDS defaults,
FASTDDS_BUILTIN_TRANSPORTS=LARGE_DATA, and our profile) and three receivers (decode messages, decode
raw bytes, and decode one layer from raw bytes). With `--best-effort`, the topic is best effort, as
for sensors and `ros2 topic hz`.

The second command prints the latency from publishing a map to the callback with the filtered map,
through the `filter_chain` node in a third process. It measures a chain of one cheap filter with 1,
4, 11 and 16 layers, and the filters demo chain on the demo terrain. `chain` is the filter time that
the node reports in its diagnostics. The first two seconds, during which processes discover each
other and allocate memory, are excluded.

The third command sends successive requests to `grid_map_server` along the path of `large_map_demo`
and prints the latency until the response is decoded. Each response contains 200 x 200 cells of a
map of 10^9 cells on disk. Run all commands in the workspace environment (`. tools/env.sh`).
"""

import argparse
import json
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

import grid_map_ros_py
from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_msgs.srv import GetGridMap
from grid_map_ros_py import from_message, from_serialized_message, to_serialized_message
from grid_map_ros_py.nodes import keep_memory, map_qos, run
from grid_map_ros_py.testing import Process, peer, running, start_node, wait_until

TOPIC = "/large_map"
FILTERED = "/filtered_map"
LAYERS = [f"layer_{k}" for k in range(8)]
LOADS = [(400, 30.0), (1000, 5.0)]
"""Side of the map [cells] and publication rate [Hz]."""

FILTERED_LOADS = [(cells, layers) for cells in (200, 400, 1000) for layers in (1, 4, 11)]
FILTERED_LOADS += [(1000, 16)]
"""Side of the map [cells] and number of layers; maps are published at `RATE`."""

RATE = 10.0
WARM_UP = 2.0
"""Time before the first measured map [s]."""

CHEAP = {"layer": "layer_0", "lower_threshold": 0.5, "set_to": 0.5}
DEMO = "demo"

PROFILE = Path(grid_map_ros_py.__file__).with_name("fastdds_large_maps.xml")
TRANSPORTS = {
    "default": {"FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"},
    "LARGE_DATA": {"FASTDDS_BUILTIN_TRANSPORTS": "LARGE_DATA"},
    "profile": {"FASTRTPS_DEFAULT_PROFILES_FILE": str(PROFILE)},
}
RECEIVERS = ["message", "raw", "raw, 1 layer"]


def qos(depth: int) -> QoSProfile:
    """Return the quality of service for maps; a negative depth means best effort."""
    if depth < 0:
        return QoSProfile(depth=-depth, reliability=ReliabilityPolicy.BEST_EFFORT)
    profile = map_qos()
    profile.depth = depth
    return profile


def made_map(load: str) -> GridMap:
    """Return a map of size `CELLSxLAYERS`, or the terrain of the filters demo."""
    if load == DEMO:
        from grid_map_demos_py.terrain import load_terrain

        return load_terrain(share("grid_map_demos_py") / "data/jacksboro_fault_dem.npz")
    cells, layers = map(int, load.split("x"))
    values = np.random.default_rng(0).random((cells, cells), np.float32)
    names = [f"layer_{k}" for k in range(layers)]
    return GridMap((cells, cells), 1.0, layers=dict.fromkeys(names, values))


def share(package: str) -> Path:
    return Path(get_package_share_directory(package))


class Publisher(Node):
    """Publishes maps while there is a subscriber.

    The timestamp of a map is its publication time; its frame is a number, counted down to 0.
    """

    def __init__(self, load: str, rate: float, count: int, depth: int) -> None:
        super().__init__("publisher")
        keep_memory()
        self._map = made_map(load)
        self._publisher = self.create_publisher(GridMapMessage, TOPIC, qos(depth))
        self._left = count
        self._cpu = 0.0
        self.create_timer(1 / rate, self._publish)

    def _publish(self) -> None:
        if not self._publisher.get_subscription_count() or not self._left:
            return
        self._cpu = self._cpu or cpu_seconds()
        self._left -= 1
        self._map.frame_id = str(self._left)
        self._map.timestamp = time.time_ns()
        self._publisher.publish(to_serialized_message(self._map))
        if not self._left:
            print(json.dumps({"cpu": cpu_seconds() - self._cpu}), flush=True)


class Subscriber(Node):
    """Decodes maps; for the last `count` maps, prints count and latencies after each map."""

    def __init__(self, topic: str, receiver: str, count: int, depth: int) -> None:
        super().__init__("subscriber")
        keep_memory()
        self._count = count
        self._latencies: list[float] = []
        self._chain = 0.0
        self._cpu = 0.0
        decode = {
            "message": from_message,
            "raw": from_serialized_message,
            "raw, 1 layer": lambda data: from_serialized_message(data, LAYERS[:1]),
        }[receiver]
        self.create_subscription(
            GridMapMessage,
            topic,
            lambda message: self._receive(decode(message)),
            qos(depth),
            raw=receiver != "message",
        )
        self.create_subscription(DiagnosticArray, "/diagnostics", self._note_chain, 10)

    def _receive(self, grid_map: GridMap) -> None:
        if int(grid_map.frame_id) >= self._count:
            return
        self._cpu = self._cpu or cpu_seconds()
        self._latencies.append(1e-6 * (time.time_ns() - grid_map.timestamp))
        half, most = np.percentile(self._latencies, [50, 95])
        report = {
            "received": len(self._latencies),
            "p50": half,
            "p95": most,
            "worst": max(self._latencies),
            "chain": self._chain,
            "cpu": cpu_seconds() - self._cpu,
        }
        print(json.dumps(report), flush=True)

    def _note_chain(self, message: DiagnosticArray) -> None:
        values = {pair.key: pair.value for status in message.status for pair in status.values}
        self._chain = float(values.get("mean ms", self._chain))


def cpu_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def measure(
    load: str, rate: float, transport: str, receiver: str, seconds: float, depth: int
) -> dict[str, float]:
    """Return the statistics of a subscriber for maps published during `seconds`."""
    count = max(int(rate * seconds), 2)
    with (
        running(_process(transport, "subscribe", TOPIC, receiver, count, depth)) as subscriber,
        running(_process(transport, "publish", load, rate, count, depth)) as publisher,
    ):
        sent, got = _reports(publisher, subscriber, seconds)
    duration = count / rate
    return {
        "sent": count,
        "lost": count - got["received"],
        "p50 ms": got["p50"],
        "p95 ms": got["p95"],
        "worst ms": got["worst"],
        "publisher CPU %": 100 * sent["cpu"] / duration,
        "subscriber CPU %": 100 * got["cpu"] / duration,
    }


def measure_filtered(load: str, seconds: float) -> dict[str, float]:
    """Return the statistics of a subscriber to filtered maps."""
    count = int(RATE * seconds)
    with TemporaryDirectory() as folder, ExitStack() as stack:
        path = Path(folder, "chain.yaml")
        if load == DEMO:
            path = share("grid_map_demos_py") / "config/filters_demo_filter_chain.yaml"
        else:
            step = {"name": "cheap", "type": "gridMapFilters/ThresholdFilter", "params": CHEAP}
            path.write_text(
                json.dumps({"/**": {"ros__parameters": {"filters": {"filter1": step}}}})
            )
        topics = [
            f"{name}_topic:={topic}" for name, topic in (("input", TOPIC), ("output", FILTERED))
        ]
        words = [word for topic in topics for word in ("-p", topic)]
        module = "grid_map_filters_py._executables.filter_chain"
        start = [module, "--ros-args", "--params-file", str(path), *words]
        subscriber = stack.enter_context(
            running(_process("profile", "subscribe", FILTERED, "raw", count, 1))
        )
        stack.enter_context(running(start_node(*start)))
        publisher = _process("profile", "publish", load, RATE, count + int(RATE * WARM_UP), 1)
        stack.enter_context(running(publisher))
        _, got = _reports(publisher, subscriber, seconds)
    names = ("p50", "p95", "worst", "chain")
    return {"sent": count, "lost": count - got["received"], **{f"{n} ms": got[n] for n in names}}


def measure_requests(count: int) -> dict[str, float]:
    """Return latencies of requests for 200 x 200 cells of a map of 10^9 cells on disk."""
    from grid_map_demos_py.large_site import END, make_site, way_at

    service, times = "/grid_map_server/get_grid_map", []
    with TemporaryDirectory() as folder, ExitStack() as stack:
        path = Path(folder, "site.zarr")
        for _ in make_site(path):
            pass
        module = "grid_map_ros_py._executables.grid_map_server"
        node = start_node(module, "--ros-args", "-p", f"source:={path}")
        stack.enter_context(running(node))
        other = stack.enter_context(peer())
        client = other.node.create_client(GetGridMap, service)
        other.wait_until(client.service_is_ready, service)
        # The first requests open the store and start its threads.
        for x in np.random.default_rng(0).uniform(-END, END, count + 20):
            request = GetGridMap.Request(position_x=x, position_y=float(way_at(x)))
            request.length_x = request.length_y = 19.9
            begin = time.perf_counter()
            answer = client.call_async(request)
            other.wait_until(answer.done, "an answer")
            grid_map = from_message(answer.result().map)
            times.append(1e3 * (time.perf_counter() - begin))
            assert min(grid_map.size) >= 199
            assert np.isfinite(grid_map["elevation"]).all()
    half, most, worst = np.percentile(times[20:], [50, 95, 100])
    return {"p50 ms": half, "p95 ms": most, "worst ms": worst}


def _reports(
    publisher: Process, subscriber: Process, seconds: float
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the reports that publisher and subscriber print after the last map."""
    wait_until(lambda: publisher.lines, "the last map", timeout=10 * seconds + 30)
    _settle(subscriber)
    return json.loads(publisher.lines[-1]), json.loads(subscriber.lines[-1])


def _process(transport: str, *arguments: object) -> Process:
    command = [sys.executable, __file__, *map(str, arguments)]
    return Process(command, TRANSPORTS[transport])


def _settle(process: Process) -> None:
    """Wait until the process has printed nothing for a second."""
    before = -1
    while before != len(process.lines) or not process.lines:
        before = len(process.lines)
        time.sleep(1.0)


def filtered_rows(seconds: float) -> Iterator[tuple[list[str], dict[str, float]]]:
    for cells, layers in FILTERED_LOADS:
        heading = [f"{cells} x {cells}", f"{layers} layers"]
        yield heading, measure_filtered(f"{cells}x{layers}", seconds)
    yield ["filters demo"], measure_filtered(DEMO, seconds)


def rows(seconds: float, depth: int) -> Iterator[tuple[list[str], dict[str, float]]]:
    for cells, rate in LOADS:
        for transport in TRANSPORTS:
            for receiver in RECEIVERS:
                heading = [f"{cells} x {cells}", f"{rate:g} Hz", transport, receiver]
                yield (
                    heading,
                    measure(f"{cells}x{len(LAYERS)}", rate, transport, receiver, seconds, depth),
                )


def main() -> int:
    if sys.argv[1:2] == ["publish"]:
        load, rate, count, depth = sys.argv[2:]
        return run(lambda: Publisher(load, float(rate), int(count), int(depth)), [])
    if sys.argv[1:2] == ["subscribe"]:
        topic, receiver, count, depth = sys.argv[2:]
        return run(lambda: Subscriber(topic, receiver, int(count), int(depth)), [])
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--depth", type=int, default=1)
    parser.add_argument("--best-effort", action="store_true")
    parser.add_argument("--filtered", action="store_true")
    parser.add_argument("--requests", type=int)
    options = parser.parse_args()
    if options.requests:
        values = measure_requests(options.requests)
        print(" | ".join(f"{name} {value:.1f}" for name, value in values.items()))
        return 0
    depth = -options.depth if options.best_effort else options.depth
    found = filtered_rows(options.seconds) if options.filtered else rows(options.seconds, depth)
    for heading, values in found:
        cells = [f"{name} {value:.1f}" for name, value in values.items()]
        print(" | ".join(heading + cells), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
