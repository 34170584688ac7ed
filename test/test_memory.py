# SPDX-License-Identifier: BSD-3-Clause
"""Nodes for whose next input the memory does not suffice."""

import sys

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_message, to_point_cloud
from grid_map_ros_py.testing import Process, peer, running, wait_until

# The first input is processed without memory.
PROGRAM = """
import sys
from importlib import import_module
from itertools import count
from grid_map_core_py.elevation import RollingMap
from grid_map_ros_py import ReceivedMap
from grid_map_ros_py.nodes import ConfiguredNode

numbers = count()

def crowded(function):
    def call(*args, **options):
        if next(numbers) == 0:
            bytearray(2**62)
        return function(*args, **options)
    return call

ReceivedMap.decode = crowded(ReceivedMap.decode)
RollingMap.fuse = crowded(RollingMap.fuse)
module = import_module(sys.argv.pop(1))
nodes = [value for value in vars(module).values() if isinstance(value, type)]
(node,) = [kind for kind in nodes if issubclass(kind, ConfiguredNode) and kind != ConfiguredNode]
raise SystemExit(node.main())
"""

CHAIN = {
    "filters.filter1.name": "copy",
    "filters.filter1.type": "gridMapFilters/DuplicationFilter",
    "filters.filter1.params.input_layer": "elevation",
    "filters.filter1.params.output_layer": "copy",
}
NODES: dict[str, tuple[dict[str, object], str]] = {
    "grid_map_filters_py._executables.filter_chain": (CHAIN, "/filtered_map"),
    "grid_map_ros_py._executables.point_cloud_to_grid_map": (
        {"pose_source": "none", "robot_centric": False, "map_frame": "map"},
        "/grid_map",
    ),
}
"""Parameters and output of a node of maps and of one of clouds."""


@pytest.mark.parametrize("module", NODES)
def test_input_without_memory_is_dropped_and_the_next_served(module: str) -> None:
    parameters, output = NODES[module]
    flags = [word for name in parameters for word in ("-p", f"{name}:={parameters[name]}")]
    grid_map = GridMap((0.5, 0.3), 0.1, layers={"elevation": 1.0}, frame_id="map")
    inputs, topic, message = "maps", "/grid_map", to_message(grid_map)
    if "cloud" in module:
        inputs, topic, message = "clouds", "/points", to_point_cloud(grid_map, "elevation")
    with (
        peer() as other,
        running(Process([sys.executable, "-c", PROGRAM, module, "--ros-args", *flags])) as node,
    ):
        other.listen(output, GridMapMessage)
        other.listen("/diagnostics", DiagnosticArray, 10)

        def report() -> dict[str, str]:
            reports = other.received["/diagnostics"]
            return {one.key: one.value for one in reports[-1].status[0].values} if reports else {}

        def send() -> None:
            # A sensor's subscriber may not know the publisher yet.
            other.publish(topic, message)
            other.spin(0.3)

        wait_until(lambda: report().get(f"{inputs} dropped"), "a report", step=send)
        wait_until(lambda: report()[f"{inputs} out"] != "0", "a served input", step=send)
        assert report()[f"{inputs} dropped"] == "1"
        assert report()["last error"].endswith("out of memory")
        other.expect(output)
        assert "out of memory" in node.text
        assert "dropped a" in node.text
