# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""The node in a process of its own, over DDS."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from cpp_outputs import FOLDER, recorded
from nav_msgs.msg import GridCells, OccupancyGrid
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_message
from grid_map_ros_py.qos import map_qos

# Ranks of processes that run tests at the same time lie close together.
DOMAIN = 1 + os.getpid() % 100
TIMEOUT = 20.0
TUTORIAL = {
    "elevation_points": PointCloud2,
    "noisy_points": PointCloud2,
    "filtered_points": PointCloud2,
    "map_region": Marker,
    "elevation_grid": OccupancyGrid,
    "error_grid": OccupancyGrid,
    "surface_normals": Marker,
    "elevation_cells": GridCells,
}


class Peer:
    """The other side: publishes maps, listens to outputs, and looks at the graph."""

    def __init__(self, node: Node, executor: SingleThreadedExecutor) -> None:
        self.node = node
        self.received: dict[str, list[Any]] = {}
        self._executor = executor

    def spin_until(self, condition: Callable[[], object], what: str) -> None:
        deadline = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < deadline, f"waited in vain for {what}"
            self._executor.spin_once(timeout_sec=0.05)

    def listen(self, name: str, message_type: type, *, transient_local: bool = True) -> Any:
        messages = self.received.setdefault(name, [])
        qos = map_qos(transient_local=transient_local)
        return self.node.create_subscription(message_type, name, messages.append, qos)

    def expect(self, *names: str) -> None:
        for name in names:
            self.spin_until(lambda name=name: self.received[name], f"a message on {name}")

    def forget(self) -> None:
        for messages in self.received.values():
            messages.clear()

    def is_watched(self, topic: str = "/grid_map") -> bool:
        """Tell whether the node subscribes to the map."""
        return self.node.count_subscribers(topic) > 0


@pytest.fixture
def peer() -> Iterator[Peer]:
    context = Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    node = Node("peer", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    yield Peer(node, executor)
    executor.shutdown()
    node.destroy_node()
    rclpy.try_shutdown(context=context)


MODULE = "grid_map_visualization_py.visualization_node"
AS_USERS_DO = ("-m", MODULE)
WITHOUT_EVENTS = (
    "-c",
    f"""
import sys
import {MODULE} as module
callbacks = module.PublisherEventCallbacks
module.PublisherEventCallbacks = lambda matched: callbacks()
sys.exit(module.main())
""",
)


@contextmanager
def running(parameter_file: Path, start: Sequence[str] = AS_USERS_DO) -> Iterator[list[str]]:
    """Run the node; it must end by an interrupt with exit code 0 and without a traceback.

    Yields the lines of its log, which grow as it runs.
    """
    process = started(parameter_file, start)
    log: list[str] = []
    reader = threading.Thread(target=lambda: [log.append(line) for line in process.stdout])
    reader.start()
    try:
        yield log
        assert process.poll() is None, log
        os.killpg(process.pid, signal.SIGINT)
        assert process.wait(TIMEOUT) == 0, log
        assert not any("Traceback" in line for line in log)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        reader.join()
        process.stdout.close()


def started(parameter_file: Path, start: Sequence[str] = AS_USERS_DO) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, *start, "--ros-args", "--params-file", str(parameter_file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={
            **os.environ,
            "ROS_DOMAIN_ID": str(DOMAIN),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        },
    )


@pytest.fixture
def parameter_file(tmp_path: Path) -> Callable[..., Path]:
    """Return a function that writes the parameters of the node into a file."""

    def write(**parameters: object) -> Path:
        path = tmp_path / "parameters.yaml"
        path.write_text(yaml.safe_dump({"grid_map_visualization": {"ros__parameters": parameters}}))
        return path

    return write


def two_outputs(**parameters: object) -> dict[str, object]:
    return {
        "grid_map_visualizations": ["region", "grid"],
        "region": {"type": "map_region"},
        "grid": {"type": "occupancy_grid", "params": {"layer": "elevation", "data_max": 1}},
        **parameters,
    }


def elevation_map(value: float, layer: str = "elevation") -> GridMapMessage:
    return to_message(GridMap((0.3, 0.2), 0.1, layers={layer: value}, frame_id="map"))


def malformed_map() -> GridMapMessage:
    message = elevation_map(0.5)
    message.info.resolution = -1.0
    return message


def cells_of(grid: OccupancyGrid) -> set[int]:
    return set(grid.data)


def test_parameter_file_of_the_cpp_node_gives_its_outputs(peer):
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    with running(FOLDER / "tutorial.yaml"):
        for name, message_type in TUTORIAL.items():
            peer.listen(name, message_type)
        peer.spin_until(lambda: publisher.get_subscription_count() == 1, "the node to subscribe")
        publisher.publish(recorded("cpp_tutorial/grid_map", GridMapMessage))
        peer.expect(*TUTORIAL)
    for name, message_type in TUTORIAL.items():
        assert peer.received[name][0] == recorded(f"cpp_tutorial/{name}", message_type), name


def test_node_subscribes_while_somebody_listens(peer, parameter_file):
    with running(parameter_file(**two_outputs(grid_map_topic="/terrain"))):
        peer.spin_until(lambda: peer.node.count_publishers("region"), "the outputs")
        assert not peer.is_watched("/terrain")
        (output,) = peer.node.get_publishers_info_by_topic("region")
        assert output.qos_profile.durability == map_qos().durability
        assert output.qos_profile.reliability == map_qos().reliability

        first, second = peer.listen("region", Marker), peer.listen("grid", OccupancyGrid)
        peer.spin_until(lambda: peer.is_watched("/terrain"), "the node to subscribe")
        peer.node.destroy_subscription(first)
        publisher = peer.node.create_publisher(GridMapMessage, "/terrain", map_qos())
        publisher.publish(elevation_map(0.5))
        peer.expect("grid")
        assert peer.is_watched("/terrain")
        assert not peer.received["region"]

        peer.node.destroy_subscription(second)
        peer.spin_until(lambda: not peer.is_watched("/terrain"), "the node to unsubscribe")
        # What was published while nobody listened is not shown later.
        publisher.publish(elevation_map(0.25))
        peer.forget()
        peer.listen("grid", OccupancyGrid)
        peer.spin_until(lambda: publisher.get_subscription_count(), "the node to come back")
        publisher.publish(elevation_map(0.75))
        peer.spin_until(lambda: [75] * 6 in [list(m.data) for m in peer.received["grid"]], "75")
        assert {75, 50} >= set().union(*map(cells_of, peer.received["grid"]))


@pytest.mark.parametrize("transient_local", [True, False])
def test_listener_who_comes_late_gets_the_map_that_was_published_once(
    peer, parameter_file, transient_local
):
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    publisher.publish(elevation_map(0.5))
    # The regular check comes too late here.
    parameters = two_outputs(transient_local=True, activity_check_rate=0.01)
    with running(parameter_file(**parameters)):
        peer.listen("region", Marker, transient_local=transient_local)
        peer.expect("region")
        # The other output has not been made yet.
        peer.listen("grid", OccupancyGrid, transient_local=transient_local)
        peer.expect("grid")
        assert cells_of(peer.received["grid"][0]) == {50}
        # And for the second listener of an output it has.
        peer.forget()
        peer.listen("grid", OccupancyGrid, transient_local=transient_local)
        peer.expect("grid")


def test_listeners_are_noticed_where_the_middleware_does_not_tell(peer, parameter_file):
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    publisher.publish(elevation_map(0.5))
    with running(
        parameter_file(**two_outputs(transient_local=True, activity_check_rate=10)), WITHOUT_EVENTS
    ):
        region = peer.listen("region", Marker)
        peer.expect("region")
        grid = peer.listen("grid", OccupancyGrid)
        peer.expect("grid")
        peer.node.destroy_subscription(region)
        peer.node.destroy_subscription(grid)
        peer.spin_until(lambda: not peer.is_watched(), "the node to unsubscribe")


def test_map_that_cannot_be_shown_is_reported_once_and_the_others_go_on(peer, parameter_file):
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    with running(parameter_file(**two_outputs())) as log:
        peer.listen("region", Marker)
        peer.listen("grid", OccupancyGrid)
        peer.spin_until(lambda: publisher.get_subscription_count() == 1, "the node to subscribe")
        for _ in range(2):
            peer.forget()
            publisher.publish(elevation_map(0.5, layer="height"))
            peer.expect("region")
            assert not peer.received["grid"]
        publisher.publish(malformed_map())
        # The next map would take its place if it came too soon.
        peer.spin_until(lambda: "info.resolution" in "".join(log), "the error")
        publisher.publish(elevation_map(0.5))
        peer.expect("grid")
    start, *problems = log
    assert "shows /grid_map as region, grid" in start
    assert len(problems) == 2
    assert "visualization 'grid': no layer 'elevation'; available: height" in problems[0]
    assert "info.resolution: expected a positive finite number, found -1.0" in problems[1]


def test_example_file_makes_an_output_of_every_type(peer):
    path = Path(__file__).parent.parent / "config" / "grid_map_visualization.yaml"
    names = yaml.safe_load(path.read_text())["grid_map_visualization"]["ros__parameters"][
        "grid_map_visualizations"
    ]
    with running(path):
        for name in names:
            peer.spin_until(lambda name=name: peer.node.count_publishers(name), name)


def test_empty_list_of_visualizations_is_no_error(peer, tmp_path):
    path = tmp_path / "parameters.yaml"
    path.write_text("grid_map_visualization: {ros__parameters: {grid_map_visualizations: []}}\n")
    with running(path):
        names = peer.node.get_node_names
        peer.spin_until(lambda: "grid_map_visualization" in names(), "the node")


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (
            {"grid": {"type": "occupancy_grid", "params": {"layer": "a", "data_mix": 1}}},
            ["visualization 'grid'", "'occupancy_grid'", "'data_mix'", "data_min"],
        ),
        ({"grid": {"type": "occupancy_gird"}}, ["visualization 'grid'", "'occupancy_gird'"]),
        ({"activity_check_rate": 0}, ["activity_check_rate", "positive", "0.0"]),
        ({"grid_map_topic": 7}, ["grid_map_topic", "string", "7"]),
        ({"grid_map_visualizations": ["grid", "grid"]}, ["'grid'", "more than once"]),
        (
            {"grid_map_visualizations": ["no topic"], "no topic": {"type": "map_region"}},
            ["'no topic'"],
        ),
    ],
)
def test_misconfigured_node_ends_with_exit_code_1_and_one_message(
    parameter_file, parameters, words
):
    process = started(parameter_file(**two_outputs(**parameters)))
    output, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1, output
    assert "Traceback" not in output
    assert len(output.strip().splitlines()) == 1
    for word in words:
        assert word in output
