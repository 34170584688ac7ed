# SPDX-License-Identifier: BSD-3-Clause
"""Run all nodes at 30 Hz, disturb them, and check for growth, leaks and wrong message counts.

    python3 benchmarks/soak.py --seconds 600

The nodes receive maps of 403 x 344 cells, and clouds of the same size. One message in 50 is invalid
(inconsistent). Meanwhile, publishers restart, the simulated clock jumps, parameters are set,
services are called, a browser stops reading, a subscriber callback blocks for 5 s, and the process
of this subscriber is frozen for 5 s. A table appears every minute:

- Hz: maps out per second.
- sent, in, out, dropped: messages sent by the sources; maps counted in the node's diagnostics.
  `sent` may exceed `in`, because a new map replaces a map that a busy node has not received yet.
- MB, now: smallest resident memory during a pause of the source, in the first pause after two
  minutes and in the last pause. (Outside the one pause per minute, memory varies with the number of
  messages in transit.) Shared memory is excluded, because its segments have a fixed size and each
  process keeps the pages it has read.
- files, now: smallest number of file descriptors in these pauses.

The exit code is 1 if a node ends, a request fails, or one of these conditions is violated:

- Memory and files grow by at most 1 %, computed as the median slope between any two pauses, times
  the duration. No shared memory is left behind.
- `in` is the sum of `out` and `dropped`, `out` equals the count of the node's publisher, and no
  more messages are dropped than were invalid.
- At most `--gap` seconds pass between two maps of a node (without an output: between two reports of
  maps in), unless its source restarts or pauses. A node that hangs violates this on any machine.
  Fast DDS may block nodes that publish to a frozen process (see "One process stops, and others
  hang" in docs/troubleshooting.md), so nodes with such a subscriber get another 5 s.

web_viewer runs only if viser is installed, rerun_viewer only with Rerun. Run the script in the
workspace environment (`. tools/env.sh`).
"""

import argparse
import json
import math
import re
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from itertools import combinations, count, cycle
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import yaml
from ament_index_python.packages import get_package_share_directory
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid, Odometry
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_core_py.tiled import TiledMap
from grid_map_demos_py.terrain import load_terrain
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_msgs.srv import GetGridMap, ProcessFile
from grid_map_ros_py import save_to_bag, to_message, to_point_cloud
from grid_map_ros_py.messages import serialize
from grid_map_ros_py.nodes import map_qos, run
from grid_map_ros_py.testing import Peer, Process, peer, wait_until

RATE = 30.0
CELLS = 403, 344
RESOLUTION = 0.03
BAD_EVERY = 50

MAPS, CLOUDS = "/soak/maps", "/soak/clouds"
POSES = "/soak/poses"
VIEWED: dict[str, tuple[str, type]] = {
    "filter_chain": ("/soak/filtered", GridMapMessage),
    "grid_map_loader": ("/soak/loaded", GridMapMessage),
    "grid_map_server": ("/soak/served", GridMapMessage),
    "grid_map_visualization": ("/region", Marker),
    "point_cloud_to_grid_map": ("/soak/mapped", GridMapMessage),
}
"""Topics and types of the nodes whose viewer stops reading from time to time, by node name."""

STALL = 5.0
"""Time for which the viewer stops reading [s]."""

STALLS = (signal.SIGSTOP, signal.SIGCONT, signal.SIGUSR1, 0)
"""Signals sent to the viewer in turn, one every `STALL` seconds."""

VISER, RERUN = (find_spec(name) is not None for name in ("viser", "rerun_cli"))


# --- sources --------------------------------------------------------------------------------------


def terrain() -> GridMap:
    path = Path(get_package_share_directory("grid_map_demos_py"), "data/jacksboro_fault_dem.npz")
    grid_map = load_terrain(path, RESOLUTION, frame_id="map")
    assert grid_map.size == CELLS
    return grid_map


def messages() -> Iterator[tuple[str, type, bytes, bytes]]:
    """Yield each topic, its type, a valid message and an invalid message."""
    grid_map = terrain()
    message = to_message(grid_map)
    intact = serialize(message)
    message.layers.append("missing")
    yield MAPS, GridMapMessage, intact, serialize(message)
    cloud = to_point_cloud(grid_map, "elevation")
    intact = serialize(cloud)
    cloud.width += 1
    yield CLOUDS, PointCloud2, intact, serialize(cloud)
    pose = Odometry()
    pose.header.frame_id, pose.pose.pose.orientation.w = "map", 1.0
    intact = serialize(pose)
    pose.pose.pose.orientation.w = 0.0
    yield POSES, Odometry, intact, serialize(pose)


class Source(Node):
    """Publishes messages with their numbers as stamps; prints the counts at start and end."""

    def __init__(self) -> None:
        super().__init__("soak_source")
        self._sent: dict[str, int] = {}
        for topic, kind, intact, bad in messages():
            publisher = self.create_publisher(kind, topic, map_qos())
            self.create_timer(1 / RATE, self._publishing(publisher, bytearray(intact), bad))
        print("{}")

    def destroy_node(self) -> None:
        print(json.dumps(self._sent))
        Node.destroy_node(self)

    def _publishing(self, publisher: Any, intact: bytearray, bad: bytes) -> Callable[[], None]:
        numbers = count(1)

        def publish() -> None:
            number = next(numbers)
            # The stamp follows the 4 bytes of the encapsulation.
            struct.pack_into("<i", intact, 4, number)
            publisher.publish(bytes(intact) if number % BAD_EVERY else bad)
            self._sent[publisher.topic_name] = number

        return publish


class Viewer(Node):
    """Subscribes to nodes; SIGUSR1 blocks the executor for `STALL` seconds, like a callback."""

    def __init__(self) -> None:
        super().__init__("soak_viewer")
        signal.signal(signal.SIGUSR1, lambda *_: time.sleep(STALL))
        for topic, kind in VIEWED.values():
            self.create_subscription(kind, topic, lambda _: None, map_qos(), raw=True)
        print("views")


# --- nodes under test -----------------------------------------------------------------------------


@dataclass
class Subject:
    """A node under test.

    Attributes:
        module: module of the executable.
        parameters: parameters of the node.
        source: topic of the input messages; empty if there is no input.
        output: topic of the output messages; empty if there is no output.
        kind: type of the output messages.
        publishes_all: True if the node publishes a map per input message, even if unsubscribed.
        process: process of the node.
        counts: numbers of maps in, out and dropped, from the diagnostics.
        published: number of messages on `output`, counted by the publisher.
        last: time [s] and number of the last message on `output`; 0 before the first message.
        gap: longest time between two messages on `output`, and the end of this gap [s].
        samples: smallest memory (excluding shared memory) [MB] and file count, by pause start [s].
    """

    module: str
    parameters: dict[str, Any]
    source: str = ""
    output: str = ""
    kind: type = GridMapMessage
    publishes_all: bool = True
    process: Any = None
    counts: tuple[int, ...] = (0, 0, 0)
    published: int = 0
    last: tuple[float, int] = (0.0, 0)
    gap: tuple[float, float] = (0.0, 0.0)
    samples: dict[float, tuple[float, int]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return self.module.rpartition(".")[2]

    def start(self, folder: Path) -> None:
        path = folder / f"{self.name}.yaml"
        parameters = {"use_sim_time": True, **self.parameters}
        path.write_text(yaml.safe_dump({"/**": {"ros__parameters": parameters}}))
        node = ["--ros-args", "--params-file", str(path), "-r", f"__node:={self.name}"]
        self.process = Process([sys.executable, "-m", self.module, *node])

    def note(self, stamp: float, number: int, earliest: float) -> None:
        """Note a message, and the gap before it unless the gap began before `earliest` [s]."""
        before, last = self.last
        if before > earliest:
            # The observer may have lost messages.
            self.note_gap(before, stamp, max(1, number - last))
        self.last, self.published = (stamp, number), number

    def note_gap(self, begin: float, end: float, count: int = 1) -> None:
        """Note `count` equal gaps between `begin` and `end` [s]."""
        self.gap = max(self.gap, ((end - begin) / count, end))

    def sample(self, pause: float | None) -> None:
        """Note memory and files of the process in the pause that began at `pause` [s], if any."""
        folder = Path("/proc", str(self.process.pid))
        with suppress(OSError, KeyError):  # The process has ended.
            if pause is not None:
                status = dict(re.findall(r"(\w+):\s+(\d+) kB", (folder / "status").read_text()))
                memory = (int(status["VmRSS"]) - int(status["RssShmem"])) / 1024
                least, fewest = self.samples.get(pause, (math.inf, sys.maxsize))
                files = len(list((folder / "fd").iterdir()))
                self.samples[pause] = min(least, memory), min(fewest, files)


def subjects(folder: Path) -> list[Subject]:
    ros, viewing = "grid_map_ros_py._executables", "grid_map_visualization_py._executables"
    step = {"layer": "elevation", "lower_threshold": 0.5, "set_to": 0.5}
    chain = {"filter1": {"name": "raise", "type": "gridMapFilters/ThresholdFilter", "params": step}}
    outputs = {
        "grid_map_visualizations": ["grid", "region"],
        "grid": {
            "type": "occupancy_grid",
            "params": {"layer": "elevation", "data_min": 0.0, "data_max": 1.0},
        },
        "region": {"type": "map_region"},
    }
    fixed = {
        "pose_source": "none",
        "map_frame": "map",
        "robot_centric": False,
        "length": [RESOLUTION * cells for cells in CELLS],
        "resolution": RESOLUTION,
        # Memory of queued clouds is not released, and a stall may fill the queue at any time.
        "queue_size": 1,
        # With small Fast DDS buffers, best effort does not deliver clouds of this size.
        "input_reliability": "reliable",
    }
    # Every map is merged into the store from which the window is read.
    TiledMap.create(folder / "site.zarr", terrain().geometry, ["elevation"], chunks=128)
    stored = {
        "source": str(folder / "site.zarr"),
        "length": 5.0,
        "pose_source": "odometry",
        "pose_topic": POSES,
        "write_back": True,
        "write_topic": MAPS,
        "output_topic": "/soak/window",
    }
    bag = str(folder / "loaded")
    save_to_bag(terrain(), bag, "/grid_map")
    rows: list[tuple[str, dict[str, Any], str, str]] = [
        (
            "grid_map_filters_py._executables.filter_chain",
            {"input_topic": MAPS, "output_topic": "/soak/filtered", "filters": chain},
            MAPS,
            "/soak/filtered",
        ),
        (
            f"{ros}.grid_map_server",
            {"input_topic": MAPS, "output_topic": "/soak/served", "directory": str(folder)},
            MAPS,
            "/soak/served",
        ),
        (f"{ros}.grid_map_loader", {"file_path": bag, "publish_topic": "/soak/loaded"}, "", ""),
        (
            f"{ros}.grid_map_saver",
            {"grid_map_topic": MAPS, "file_path": str(folder / "saved"), "continuous": True},
            MAPS,
            "",
        ),
        (
            "grid_map_demos_py.terrain_publisher_node",
            {"topic": "/soak/terrain", "publish_rate": RATE},
            "",
            "/soak/terrain",
        ),
    ]
    if VISER:
        coarse = {"grid_map_topic": MAPS, "port": 0, "max_drawn_cells": 20_000, "update_rate": 5.0}
        rows.append((f"{viewing}.web_viewer", coarse, MAPS, ""))
    if RERUN:
        coarse = {"topics": [MAPS], "port": 0, "max_drawn_cells": 20_000, "max_rate": 1.0}
        rows.append((f"{viewing}.rerun_viewer", {**coarse, "memory_limit": "100MB"}, MAPS, ""))
    visualization = f"{viewing}.grid_map_visualization"
    near = {
        "input_sources": {
            "points": {
                "topic": CLOUDS,
                "max_range": 3.0,
                "queue_size": 1,
                "reliability": "reliable",
            }
        },
        "pose_source": "none",
        "map_frame_id": "map",
        "length_in_x": 6.0,
        "length_in_y": 6.0,
        "resolution": RESOLUTION,
        "directory": str(folder),
    }
    elevation = "/elevation_mapping/elevation_map_raw"
    return [
        *(Subject(*row) for row in rows),
        Subject(
            f"{ros}.point_cloud_to_grid_map",
            {"input_topic": CLOUDS, "output_topic": "/soak/mapped", **fixed},
            CLOUDS,
            "/soak/mapped",
            publishes_all=False,
        ),
        Subject(f"{ros}.grid_map_window", stored, MAPS, "/soak/window", publishes_all=False),
        Subject(f"{ros}.elevation_mapping", near, CLOUDS, elevation, publishes_all=False),
        Subject(visualization, {"grid_map_topic": MAPS, **outputs}, MAPS, "/grid", OccupancyGrid),
    ]


def segments(process: int | str) -> set[Path]:
    """Return the shared memory segments that a process uses.

    The small port files, which all processes share, are excluded: Fast DDS reuses them, and leaves
    some of them behind when several processes end at once, even plain rclpy processes.
    """
    maps = ""
    with suppress(OSError):  # The process has ended.
        maps = Path("/proc", str(process), "maps").read_text()
    return set(map(Path, re.findall(r"/dev/shm/fastrtps_[0-9a-f]{16}\b", maps)))


def growth(values: Mapping[float, float]) -> float:
    """Return the growth of values from the first to the last time, from the median slope."""
    pairs = combinations(sorted(values.items()), 2)
    slopes = [(after - before) / (end - begin) for (begin, before), (end, after) in pairs]
    return median(slopes) * (max(values) - min(values)) if slopes else 0.0


# --- the run --------------------------------------------------------------------------------------


class Soak:
    """Runs the nodes, feeds and disturbs them, and records their statistics.

    Args:
        observer: peer that subscribes to the outputs and calls services.
        folder: folder for bags and parameter files.
        seconds: duration [s].
        names: nodes to run; all if empty.
        gap: longest time between two maps of a node [s].

    Attributes:
        subjects: nodes under test.
        sent: numbers of messages sent by the sources, by topic.
        bad: numbers of invalid messages among `sent`, by topic.
        problems: descriptions of violated conditions.
        segments: shared memory segments that the processes have used.
    """

    def __init__(
        self,
        observer: Peer,
        folder: Path,
        seconds: float,
        *,
        names: Collection[str] = (),
        gap: float = 2.0,
    ) -> None:
        self.problems: list[str] = []
        self.segments: set[Path] = set()
        self._observer, self._folder, self._seconds = observer, folder, seconds
        self._gap = gap
        self.subjects = [each for each in subjects(folder) if not names or each.name in names]
        self._sources: list[Process] = []
        self.sent: dict[str, int] = {}
        self.bad: dict[str, int] = {}
        self._undisturbed = math.inf
        self._is_paused = False
        self._answers: dict[str, list[Any]] = {}
        self._browsed = 0
        self._is_over = threading.Event()
        self._begin = time.monotonic()

    @property
    def _elapsed(self) -> float:
        return time.monotonic() - self._begin

    def run(self, growth: float) -> None:
        """Run the test; memory and files may grow by a factor of 1 + `growth`."""
        with ExitStack() as stack:
            for subject in self.subjects:
                subject.start(self._folder)
                stack.callback(subject.process.stop)
                self._count(subject)
            node = self._observer.node
            node.create_subscription(DiagnosticArray, "/diagnostics", self._note_counts, 100)
            stack.callback(lambda: [source.stop() for source in self._sources])
            self._restart_source()
            spin = partial(self._observer.spin, 0.1)
            wait_until(self._has_begun, "all nodes", step=spin, timeout=120)
            # Start last, or grid_map_visualization would first process maps for the viewer alone.
            self._viewer = Process([sys.executable, __file__, "view"])
            stack.callback(self._viewer.kill)
            # Stop the nodes briefly, so that queues reach their maximum length.
            for number in (signal.SIGSTOP, signal.SIGCONT):
                for subject in self.subjects:
                    subject.process.send_signal(number)
                self._observer.spin(1.0)
            wait_until(lambda: self._viewer.lines, "the viewer", step=spin)
            self._begin, self._undisturbed = time.monotonic(), time.time()
            timers = self._disturb()
            self._observer.spin(self._seconds)
            # A busy machine may need longer.
            with suppress(AssertionError):
                self._observer.wait_until(lambda: not any(self._unanswered()), "the first answers")
            self.problems += self.gaps(time.time())
            for timer in timers:
                timer.cancel()
            self._is_over.set()
            self._end_sources()
            with suppress(AssertionError):
                self._observer.wait_until(lambda: not any(self.miscounts()), "the last counts")
            print(self.table(), flush=True)
            self.problems += [*self.miscounts(), *self.leaks(growth)]
            self._end_nodes()

    def _has_begun(self) -> bool:
        outputs = [each.published for each in self.subjects if each.output]
        # web_viewer receives nothing while no browser is connected.
        return all(outputs or [each.counts[0] for each in self.subjects])

    def _count(self, subject: Subject) -> None:
        def note(_: bytes, info: dict[str, int]) -> None:
            number, stamp = info["publication_sequence_number"], 1e-9 * info["source_timestamp"]
            subject.note(stamp, number, self._undisturbed if subject.source else math.inf)

        if subject.output:
            node = self._observer.node
            node.create_subscription(subject.kind, subject.output, note, map_qos(), raw=True)

    def _note_counts(self, message: DiagnosticArray, info: dict[str, int]) -> None:
        for status in message.status:
            # Keys are, for example, "maps in" or "clouds in".
            values = {pair.key.partition(" ")[2]: pair.value for pair in status.values}
            for subject in self.subjects:
                if subject.name == status.name.partition(":")[0]:
                    before = subject.counts
                    subject.counts = tuple(int(values[key]) for key in ("in", "out", "dropped"))
                    if subject.source and not subject.output and subject.counts > before:
                        stamp = 1e-9 * info["source_timestamp"]
                        subject.note(stamp, subject.last[1] + 1, self._undisturbed)

    # --- disturbances -----------------------------------------------------------------------------

    def _disturb(self) -> list[Timer]:
        """Start the timers for disturbances, samples and tables."""
        every = self._observer.node.create_timer
        clock = self._observer.node.create_publisher(Clock, "/clock", 1)
        requests = [request for subject in self.subjects for request in self._requests(subject)]
        stalls = cycle(STALLS)

        def tick() -> None:
            now, message = self._elapsed, Clock()
            # Every ten seconds, the clock jumps forward or backward by an hour.
            message.clock.sec = 10_000 + int(now) + 3600 * (int(now / 10) % 2)
            message.clock.nanosec = int(1e9 * (now % 1))
            clock.publish(message)

        for subject in self.subjects:
            if subject.name == "web_viewer":
                threading.Thread(target=self._browse, args=[subject.process], daemon=True).start()
        return [
            every(0.1, tick),
            every(1.0, self._sample),
            every(2.0, lambda: [request() for request in requests]),
            every(STALL, lambda: self._viewer.send_signal(next(stalls))),
            every(min(30.0, self._seconds / 3), self._restart_source),
            every(60.0, lambda: print(self.table(), flush=True)),
        ]

    def _restart_source(self) -> None:
        """End the source and start a new source, unless it pauses or has not begun yet."""
        if not self._is_paused and all(source.lines for source in self._sources):
            for source in self._sources[-1:]:
                source.send_signal(signal.SIGINT)
            self._undisturbed = math.inf
            self._sources.append(Process([sys.executable, __file__, "publish"]))

    def _pauses(self) -> Iterator[tuple[float, float]]:
        """Yield the begin and end of each pause of the source [s].

        Memory has settled by then. Subscribers would drop a source that pauses for 20 s.
        """
        minute, settled = min(60.0, self._seconds / 5), min(120.0, self._seconds / 5)
        for number in range(round(settled / minute), round(self._seconds / minute)):
            yield (number + 0.1) * minute, (number + 0.3) * minute

    def _pause(self, is_paused: bool) -> None:
        """Stop or continue the source."""
        if is_paused != self._is_paused and all(source.lines for source in self._sources):
            self._sources[-1].send_signal(signal.SIGSTOP if is_paused else signal.SIGCONT)
            self._is_paused, self._undisturbed = is_paused, math.inf

    def _requests(self, subject: Subject) -> Iterator[Callable[[], None]]:
        """Yield functions that call services of a node."""
        settings: dict[str, list[Any]] = {"use_sim_time": [True, False]}
        if subject.name == "filter_chain":
            # The node rejects the string.
            settings["filters.filter1.params.lower_threshold"] = [0.4, "high", 0.6]
        for name, values in settings.items():
            parameters = (Parameter(name, value=value).to_parameter_msg() for value in values)
            changes = [SetParameters.Request(parameters=[parameter]) for parameter in parameters]
            yield self._calling(SetParameters, f"/{subject.name}/set_parameters", changes)
        if subject.name == "grid_map_server":
            yield self._calling(GetGridMap, f"/{subject.name}/get_grid_map", [GetGridMap.Request()])
            request = ProcessFile.Request(file_path="requested")
            yield self._calling(ProcessFile, f"/{subject.name}/save_map", [request])
        if subject.name == "elevation_mapping":
            name = f"/{subject.name}/get_submap"
            yield self._calling(GetGridMap, name, [GetGridMap.Request()])
            request = ProcessFile.Request(file_path="mapped")
            yield self._calling(ProcessFile, f"/{subject.name}/save_map", [request])

    def _calling(self, kind: type, name: str, requests: list[Any]) -> Callable[[], None]:
        """Return a function that calls a service unless the previous call is still pending."""
        client, turns = self._observer.node.create_client(kind, name), cycle(requests)
        answers: list[Any] = []
        self._answers[name] = answers

        def call() -> None:
            if client.service_is_ready() and (not answers or answers[-1].done()):
                answers[:] = [client.call_async(next(turns))]

        return call

    def _browse(self, viewer: Process) -> None:
        """Visit the page repeatedly; note failures."""
        try:
            self._visit(viewer)
        except Exception as error:
            self.problems.append(f"a browser failed: {error!r}")

    def _visit(self, viewer: Process) -> None:
        """Repeatedly connect to the page, read for 5 s, wait 5 s, and disconnect for 5 s."""
        import viser
        from msgspec import msgpack
        from websockets.sync.client import connect

        camera: dict[str, Any] = {"type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0)}
        camera |= dict.fromkeys(("position", "look_at", "up_direction"), (1.0, 2.0, 3.0))
        camera |= {"fov": 1.0, "near": 0.1, "far": 9.0, "image_height": 400, "image_width": 400}
        protocol: Any = f"viser-v{viser.__version__}"
        wait_until(lambda: "http://" in viewer.text, "the page")
        address = "ws://" + re.findall(r"http://(\S+)", viewer.text)[0]
        # Unread data would delay closing.
        options: Any = {"subprotocols": [protocol], "max_size": None, "close_timeout": 0.1}
        while not self._is_over.is_set():
            with connect(address, **options) as socket:
                socket.send(msgpack.encode(camera))
                end = time.monotonic() + 5
                while time.monotonic() < end and not self._is_over.is_set():
                    with suppress(TimeoutError):
                        self._browsed += len(socket.recv(0.1))
                self._is_over.wait(5)
            self._is_over.wait(5)

    # --- figures ----------------------------------------------------------------------------------

    def _sample(self) -> None:
        begins = (first for first, last in self._pauses() if first < self._elapsed < last)
        pause = next(begins, None)
        self._pause(pause is not None)
        if math.isinf(self._undisturbed) and not self._is_paused and self._sources[-1].lines:
            # By then, subscribers have discovered the source.
            self._undisturbed = time.time() + 3
        processes = [subject.process for subject in self.subjects]
        for subject in self.subjects:
            subject.sample(pause)
        for process in (*processes, *self._sources, self._viewer):
            self.segments |= segments(process.pid)
        self.segments |= segments("self")

    def _end_sources(self) -> None:
        """End the sources and the viewer, and sum up the counts of sent messages."""
        self._viewer.send_signal(signal.SIGCONT)
        wait_until(lambda: self._sources[-1].lines, "the last source")
        self._pause(False)
        for process in (self._sources[-1], self._viewer):
            process.send_signal(signal.SIGINT)
        for process in (*self._sources, self._viewer):
            if process.wait() != 0:
                self.problems.append(f"a source or viewer failed: {process.text}")
        for source in self._sources:
            counts = [line for line in source.lines if line.startswith("{")]
            for topic, sent in json.loads(counts[-1]).items():
                self.sent[topic] = self.sent.get(topic, 0) + sent
                self.bad[topic] = self.bad.get(topic, 0) + sent // BAD_EVERY

    def _end_nodes(self) -> None:
        for subject in self.subjects:
            if subject.process.is_running:
                subject.process.send_signal(signal.SIGINT)
            else:
                self.problems.append(f"{subject.name} ended before the soak")
        for subject in self.subjects:
            code, text = subject.process.wait(), subject.process.text
            if code != 0 or "Traceback" in text:
                self.problems.append(f"{subject.name} ended with code {code}: {text[-2000:]}")

    def _unanswered(self) -> Iterator[str]:
        for name, answers in self._answers.items():
            if not answers or not answers[-1].done():
                yield f"{name} does not answer"
        if self._browsed == 0 and any(each.name == "web_viewer" for each in self.subjects):
            yield "web_viewer: a browser has got nothing"

    def miscounts(self) -> Iterator[str]:
        yield from self._unanswered()
        for subject in self.subjects:
            name, (taken, out, dropped) = subject.name, subject.counts
            sent, bad = (figures.get(subject.source, 0) for figures in (self.sent, self.bad))
            if subject.source and not sent >= taken == out + dropped >= 1:
                yield f"{name}: {sent} sent, {taken} in, {out} out, {dropped} dropped"
            counts = subject.source and subject.output and subject.publishes_all
            if counts and out != subject.published:
                yield f"{name}: {out} out, but its publisher counted {subject.published}"
            # An invalid map may have been replaced before the node received it.
            if not bad - (sent - taken) <= dropped <= bad:
                yield f"{name}: {dropped} dropped, but {bad} contradicted themselves"

    def gaps(self, now: float) -> Iterator[str]:
        """Yield a text for each node that was silent for too long before `now` [s]."""
        for subject in self.subjects:
            if subject.source:
                if now > self._undisturbed:
                    subject.note_gap(max(subject.last[0], self._undisturbed), now)
                gap, end = subject.gap
                if gap > self._gap + (STALL if subject.name in VIEWED else 0.0):
                    moment = end - now + self._elapsed
                    yield f"{subject.name}: {gap:.1f} s without a map, until {moment:.0f} s"

    def leaks(self, limit: float) -> Iterator[str]:
        for subject in self.subjects:
            for index, unit in enumerate(("MB", "files")):
                values = {time: sample[index] for time, sample in subject.samples.items()}
                if values and (more := growth(values)) > limit * values[min(values)]:
                    yield f"{subject.name}: {more:.1f} {unit} more than {values[min(values)]:.1f}"

    def table(self) -> str:
        """Return the statistics so far; the sources report `sent` only at the end."""
        columns = "Hz   sent     in    out dropped   MB   now files now"
        heading = f"{'node':23} {columns:>56}"
        lines = [f"\nafter {self._elapsed:.0f} s", heading]
        duration = min(self._elapsed, self._seconds)
        for subject in self.subjects:
            taken, out, dropped = subject.counts
            rate = (subject.published if subject.output else out) / duration
            sent = self.sent.get(subject.source, "")
            samples = [subject.samples[key] for key in sorted(subject.samples)] or [(math.nan, 0)]
            (before, files), (after, more_files) = samples[0], samples[-1]
            lines.append(
                f"{subject.name:23} {rate:5.1f}"
                f" {sent:6} {taken:6} {out:6} {dropped:7}"
                f" {before:4.0f} {after:5.1f} {files:5} {more_files:3}"
            )
        return "\n".join(lines)


def main() -> int:
    if sys.argv[1:2] == ["publish"]:
        return run(Source, [])
    if sys.argv[1:2] == ["view"]:
        return run(Viewer, [])
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=600.0, help="duration (%(default)s)")
    text = "largest growth of resident memory, and of the number of files [%%] (%(default)s)"
    parser.add_argument("--growth", type=float, default=1.0, help=text)
    text = "longest time between two maps of a node [s] (%(default)s)"
    parser.add_argument("--gap", type=float, default=2.0, help=text)
    nodes = "run these nodes only, by the names of the table"
    parser.add_argument("--nodes", nargs="+", default=(), metavar="NODE", help=nodes)
    options = parser.parse_args()
    # In memory, because few disks can synchronize 30 maps per second.
    with TemporaryDirectory(dir="/dev/shm") as folder, peer() as observer:
        names, gap = options.nodes, options.gap
        soak = Soak(observer, Path(folder), options.seconds, names=names, gap=gap)
        soak.run(options.growth / 100)
    left = sorted(map(str, filter(Path.exists, soak.segments)))
    problems = [*soak.problems, *(f"left behind: {name}" for name in left)]
    print("\n".join(f"missed: {problem}" for problem in problems) or "all figures are met")
    return bool(problems)


if __name__ == "__main__":
    sys.exit(main())
