# SPDX-License-Identifier: BSD-3-Clause
"""The `rerun_viewer` node: messages over DDS, read back by a second client of Rerun."""

import itertools
import os
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry, Path as PathMessage
from std_msgs.msg import Header, String
from test_node_web_viewer import CHROMIUM, FLAGS, decoded, triangle, url_of
from test_rerun_server import rerun
from visualization_msgs.msg import Marker, MarkerArray

from grid_map_core_py import GridMap
from grid_map_ros_py import to_message, to_stamp
from grid_map_ros_py.testing import Peer, Process, running, wait_until

pytestmark = [pytest.mark.needs("rerun"), pytest.mark.timeout(900)]

MODULE = "grid_map_visualization_py._executables.rerun_viewer"

IMPATIENT = f"""
import sys
from grid_map_visualization_py._rerun import live
import {MODULE} as module
live.STALL = 1.0
sys.exit(module.RerunViewerNode.main())
"""
"""The node, which waits less long for Rerun."""

PATIENCE = 200.0
"""Seconds that a slow machine may need to draw."""


def slope(seconds: int = 5) -> GridMap:
    """Return 6 x 4 cells of 0.1 m, moved, with a hole; each height differs."""
    grid_map = GridMap((0.6, 0.4), 0.1, (1.0, 2.0), frame_id="odom", timestamp=seconds * 10**9)
    values = np.arange(24, dtype=np.float32).reshape(6, 4)
    values[2, 1] = np.nan
    grid_map["elevation"] = values
    grid_map.move((1.1, 2.0))
    return grid_map


def started(*program: str, **parameters: object) -> Process:
    given = {"port": 0, **parameters}.items()
    words = (word for name, value in given for word in ("-p", f"{name}:={value}"))
    return Process([sys.executable, *(program or ("-m", MODULE)), "--ros-args", *words])


@contextmanager
def viewer(*program: str, **parameters: object) -> Iterator[Process]:
    with running(started(*program, **parameters)) as process:
        url_of(process)
        yield process


class Client:
    """A second client, which saves what it reads."""

    def __init__(self, url: str, path: Path) -> None:
        self._path = path
        source = url.replace("http://", "rerun+http://") + "/proxy"
        options = "--save", path, "--port", "0", "--bind", "127.0.0.1", source
        self.process = subprocess.Popen([rerun(), *options], stderr=subprocess.DEVNULL)

    def columns(self, entity: str) -> dict[str, list[Any]]:
        """Return the rows of an entity so far, by the names of their columns."""
        found: dict[str, list[Any]] = {}
        for chunk in self._chunks():
            if chunk.entity_path == entity:
                for name, rows in chunk.to_record_batch().to_pydict().items():
                    found.setdefault(name, []).extend(rows)
        return found

    def _chunks(self) -> list[Any]:
        from rerun.chunk import RrdReader

        chunks: list[Any] | None = None

        def read() -> bool:
            nonlocal chunks
            # The file may end within a message.
            with suppress(RuntimeError, ValueError), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                chunks = [*RrdReader(self._path).stream()] if self._path.exists() else []
            return chunks is not None

        wait_until(read, "a complete file", timeout=PATIENCE)
        return chunks or []


@contextmanager
def client(node: Process, folder: Path) -> Iterator[Client]:
    one = Client(url_of(node), folder / "read.rrd")
    try:
        yield one
    finally:
        one.process.kill()
        one.process.wait()


def values_of(peer: Peer) -> Callable[[], dict[str, str]]:
    """Return a function that returns the values of the last report of the node."""
    peer.listen("/diagnostics", DiagnosticArray, 10)
    reports = peer.received["/diagnostics"]

    def values() -> dict[str, str]:
        found = [one for report in reports for one in report.status if one.name == "rerun_viewer"]
        return {pair.key: pair.value for pair in found[-1].values} if found else {}

    return values


def milliseconds() -> DiagnosticArray:
    pairs = [KeyValue(key="ms smooth", value="2.5"), KeyValue(key="mean ms smooth", value="1.5")]
    return DiagnosticArray(status=[DiagnosticStatus(name="filters", values=pairs)])


def test_a_second_client_reads_what_was_published(peer, tmp_path):
    odometry, pose, path = Odometry(), PoseStamped(), PathMessage()
    for message in (odometry, pose, path):
        message.header.frame_id = "odom"
    odometry.header.stamp.sec = 6
    odometry.pose.pose.position.x = 3.5
    odometry.pose.pose.orientation.w = pose.pose.orientation.w = 1.0
    path.poses = [pose, pose]
    begin = time.time()
    with viewer() as node, client(node, tmp_path) as reader:
        peer.publish("/odometry", odometry, 10)
        peer.publish("/grid_map", to_message(slope()))
        # Topics that appear later are shown, too.
        peer.publish("/route", path, 10)
        peer.publish("/diagnostics", milliseconds(), 10)
        image = "/grid_map/layers/elevation"
        expected = {
            image: "Image:buffer",
            "/grid_map/surface": "Mesh3D:vertex_positions",
            "/odometry/trail": "Points3D:positions",
            "/route": "LineStrips3D:strips",
            "/milliseconds/filters/smooth": "Scalars:scalars",
        }

        def has_come() -> bool:
            return all(name in reader.columns(entity) for entity, name in expected.items())

        peer.wait_until(has_come, "all entities")
        columns = reader.columns(image)
        (((data,),),) = [columns["Image:buffer"]]
        shown = np.array(data, np.uint8).view(np.float32).reshape(4, 6)
        # x points to the right and y up, while rows and columns of maps count against them.
        np.testing.assert_array_equal(shown, slope().unwrapped("elevation").T[:, ::-1])
        (ros_time,), (log_time,) = columns["ros_time"], columns["log_time"]
        assert ros_time.timestamp() == 5.0
        assert begin <= log_time.timestamp() <= time.time()
        (place,) = reader.columns("/odometry/trail")["Points3D:positions"]
        np.testing.assert_allclose(place, [[3.5, 0.0, 0.0]])
        (scalar,) = reader.columns("/milliseconds/filters/smooth")["Scalars:scalars"]
        assert scalar == [2.5]
        assert not reader.columns("/milliseconds/filters/mean ms smooth")


def test_bad_messages_are_dropped_and_counted(peer, tmp_path):
    values = values_of(peer)
    message = to_message(slope())
    message.info.resolution = -1.0
    with viewer(topics="[/bad_map,/words]") as node, client(node, tmp_path) as reader:
        words = peer.node.create_publisher(String, "/words", 1)
        peer.publish("/bad_map", message)
        peer.wait_until(lambda: values().get("messages dropped") == "1", "the report")
        assert "/bad_map: info.resolution: expected a positive" in values()["last error"]
        logged = "dropped a message of /bad_map: info.resolution"
        wait_until(lambda: logged in node.text, "the line")
        peer.publish("/bad_map", to_message(slope()))
        entity = "/bad_map/layers/elevation"
        peer.wait_until(lambda: reader.columns(entity), "the next")
        refused = "/words is not shown: its type is std_msgs/msg/String"
        wait_until(lambda: refused in node.text, "the other line")
        # Other topics were not chosen.
        assert "shows /grid_map" not in node.text
        peer.node.destroy_publisher(words)


def test_newest_of_many_messages_is_shown_at_the_rate(peer, tmp_path):
    values = values_of(peer)
    with viewer(topics="[/fast_map]", max_rate=0.2) as node, client(node, tmp_path) as reader:
        seconds = itertools.count(5)

        def has_replaced() -> bool:
            peer.publish("/fast_map", to_message(slope(seconds=next(seconds))))
            return int(values().get("messages replaced", "0")) >= 10

        step = lambda: peer.spin(0.02)  # noqa: E731
        wait_until(has_replaced, "replaced maps", step=step, timeout=PATIENCE)
        assert values()["messages out"] == values()["messages shown"]
        last = next(seconds)
        peer.publish("/fast_map", to_message(slope(seconds=last)))

        def times() -> list[float]:
            columns = reader.columns("/fast_map/layers/elevation")
            return [time.timestamp() for time in columns.get("ros_time", [])]

        wait_until(lambda: last in times(), "the last", step=step, timeout=PATIENCE)
        assert len(times()) <= last - 5 + 1 - 10


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL])
def test_node_goes_on_while_rerun_hangs_and_ends_with_it(peer, number):
    values = values_of(peer)
    size = np.full((200, 200), 1.0, np.float32)
    large = GridMap((20.0, 20.0), 0.1, layers={f"layer {k}": size for k in range(8)})
    message = to_message(large)
    process = started("-c", IMPATIENT, topics="[/large]")
    try:
        url_of(process)
        peer.publish("/large", message)
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
        program = int(children)
        os.kill(program, number)
        if number == signal.SIGKILL:
            assert process.wait(PATIENCE) == 1
            complaint = "the program rerun has ended with exit code -9"
            assert f"{complaint}\n" in process.text
            return

        def publish() -> None:
            peer.publish("/large", message)
            peer.spin(0.05)

        hangs = lambda: "Rerun has taken no data for" in process.text  # noqa: E731
        wait_until(hangs, "the complaint", step=publish, timeout=PATIENCE)
        rss, taken = memory_of(process), lambda: int(values()["messages in"])
        # It still takes messages, and keeps one of them.
        before = taken()
        is_taken = lambda: taken() > before + 15  # noqa: E731
        wait_until(is_taken, "messages", step=publish, timeout=PATIENCE)
        assert memory_of(process) - rss < 10 * len(message.data) * 4 * size.size
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0, process.text
        assert "Traceback" not in process.text
        wait_until(lambda: not Path(f"/proc/{program}").exists(), "the end of Rerun")
    finally:
        process.stop()


@pytest.mark.needs("playwright")
def test_regions_replace_those_of_the_last_message(peer):
    playwright = pytest.importorskip("playwright.sync_api")
    red, green, blue = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    place = {"frame_id": "odom", "timestamp": 5 * 10**9}
    ground = GridMap((2.1, 2.1), 0.1, (1.0, 2.0), {"elevation": 0.0}, **place)
    with (
        viewer(topics="[/planar_regions,/grid_map]") as node,
        playwright.sync_playwright() as driver,
    ):
        options = {"executable_path": CHROMIUM, "args": FLAGS, "timeout": 1e3 * PATIENCE}
        browser = driver.chromium.launch(**options)
        tab = browser.new_page(viewport={"width": 800, "height": 600})
        tab.set_default_timeout(1e3 * PATIENCE)
        tab.goto(f"{url_of(node)}/?renderer=webgl")

        def wait_for(shown: list[Any], hidden: list[Any]) -> None:
            def holds() -> bool:
                picture = decoded(tab.screenshot(timeout=1e3 * PATIENCE))
                is_there = [bright(picture, color) > 0.002 for color in (*shown, *hidden)]
                return is_there == [True] * len(shown) + [False] * len(hidden)

            step = lambda: tab.wait_for_timeout(500)  # noqa: E731
            wait_until(holds, f"{shown} without {hidden}", step=step, timeout=PATIENCE)

        def publish(*markers: Marker) -> None:
            # All messages have the same time.
            messages = [Marker(action=Marker.DELETEALL), *markers]
            for message in messages:
                message.header = Header(frame_id="odom", stamp=to_stamp(5 * 10**9))
            peer.publish("/planar_regions", MarkerArray(markers=messages))

        peer.publish("/grid_map", to_message(ground))
        publish(triangle(0.6, red, number=1), triangle(1.4, green, number=2))
        wait_for([red, green], [blue])
        publish(triangle(1.4, green, number=2), triangle(0.6, blue, number=3))
        wait_for([green, blue], [red])
        browser.close()


def bright(picture: np.ndarray, color: tuple[int, int, int]) -> float:
    """Return the share of pixels in which exactly these channels are bright."""
    channels = np.where(np.array(color) > 0, picture > 130, picture < 90)
    return float(channels.all(axis=-1).mean())


def memory_of(process: Process) -> int:
    """Return the memory that a process uses [bytes]."""
    pages = Path(f"/proc/{process.pid}/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")
