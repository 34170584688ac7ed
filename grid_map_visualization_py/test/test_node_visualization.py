# SPDX-License-Identifier: BSD-3-Clause
"""The `grid_map_visualization` node as a process, over DDS."""

import sys

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from messages import RECORDINGS, recorded, recorded_parameters
from nav_msgs.msg import OccupancyGrid
from visualization_msgs.msg import Marker

from grid_map_core_py import GridMap
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import to_message
from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.testing import Peer, Process, running, running_node
from grid_map_visualization_py import create

MODULE = "grid_map_visualization_py._executables.grid_map_visualization"
WITHOUT_EVENTS = f"""
import sys
import {MODULE} as module
callbacks = module.PublisherEventCallbacks
module.PublisherEventCallbacks = lambda matched: callbacks()
sys.exit(module.GridMapVisualizationNode.main())
"""
TALKATIVE = f"""
import sys
import {MODULE} as module
decode = module.ReceivedMap.decode
module.ReceivedMap.decode = lambda *args, **options: print("a map") or decode(*args, **options)
sys.exit(module.GridMapVisualizationNode.main())
"""


def forget(peer: Peer) -> None:
    for messages in peer.received.values():
        messages.clear()


def is_watched(peer: Peer, topic: str = "/grid_map") -> bool:
    """Return whether the node subscribes to the map."""
    return peer.node.count_subscribers(topic) > 0


def two_outputs(**parameters: object) -> dict[str, object]:
    return {
        "grid_map_visualizations": ["region", "grid"],
        "region": {"type": "map_region"},
        "grid": {"type": "occupancy_grid", "params": {"layer": "elevation", "data_max": 1}},
        **parameters,
    }


def elevation_map(value: float, layer: str = "elevation") -> GridMapMessage:
    return to_message(GridMap((0.3, 0.2), 0.1, layers={layer: value}, frame_id="map"))


def malformed_map(resolution: float) -> GridMapMessage:
    message = elevation_map(0.5)
    message.info.resolution = resolution
    return message


def cells_of(grid: OccupancyGrid) -> set[int]:
    return set(grid.data)


def test_parameter_file_of_the_cpp_node_gives_its_outputs(peer):
    path, parameters = RECORDINGS / "tutorial.yaml", recorded_parameters("tutorial")
    names = parameters["grid_map_visualizations"]
    types = {name: create(name, parameters[name]).message_type for name in names}
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    with running_node(MODULE, "--ros-args", "--params-file", str(path)):
        for name, message_type in types.items():
            peer.listen(name, message_type)
        peer.wait_until(lambda: publisher.get_subscription_count() == 1, "the node to subscribe")
        publisher.publish(recorded("cpp_tutorial/grid_map", GridMapMessage))
        for name, message_type in types.items():
            assert peer.expect(name) == recorded(f"cpp_tutorial/{name}", message_type), name


def test_node_subscribes_while_outputs_have_subscribers(peer, arguments):
    with running_node(MODULE, *arguments(**two_outputs(grid_map_topic="/terrain"))):
        peer.wait_until(lambda: peer.node.count_publishers("region"), "the outputs")
        assert not is_watched(peer, "/terrain")
        (output,) = peer.node.get_publishers_info_by_topic("region")
        assert output.qos_profile.durability == map_qos().durability
        assert output.qos_profile.reliability == map_qos().reliability

        first, second = peer.listen("region", Marker), peer.listen("grid", OccupancyGrid)
        peer.wait_until(lambda: is_watched(peer, "/terrain"), "the node to subscribe")
        peer.node.destroy_subscription(first)
        publisher = peer.node.create_publisher(GridMapMessage, "/terrain", map_qos())
        publisher.publish(elevation_map(0.5))
        peer.expect("grid")
        assert is_watched(peer, "/terrain")
        assert not peer.received["region"]

        peer.node.destroy_subscription(second)
        peer.wait_until(lambda: not is_watched(peer, "/terrain"), "the node to unsubscribe")
        # A map that was published without subscribers is not shown later.
        publisher.publish(elevation_map(0.25))
        forget(peer)
        peer.listen("grid", OccupancyGrid)
        peer.wait_until(lambda: publisher.get_subscription_count(), "the node to come back")
        publisher.publish(elevation_map(0.75))
        peer.wait_until(lambda: [75] * 6 in [list(m.data) for m in peer.received["grid"]], "75")
        assert {75, 50} >= set().union(*map(cells_of, peer.received["grid"]))


@pytest.mark.parametrize("transient_local", [True, False])
def test_late_listener_gets_the_map_published_before(peer, arguments, transient_local):
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    publisher.publish(elevation_map(0.5))
    # The periodic check is too late here.
    late = two_outputs(transient_local=True, activity_check_rate=0.01)
    qos = map_qos(transient_local=transient_local)
    with running_node(MODULE, *arguments(**late)):
        peer.listen("region", Marker, qos)
        peer.expect("region")
        # The other output has not been made yet.
        peer.listen("grid", OccupancyGrid, qos)
        peer.expect("grid")
        assert cells_of(peer.received["grid"][0]) == {50}
        # Likewise for the second subscriber of an output that has been made.
        forget(peer)
        peer.listen("grid", OccupancyGrid, qos)
        peer.expect("grid")


def test_polling_publishes_once_per_listener_without_middleware_events(peer, arguments):
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    publisher.publish(elevation_map(0.5))
    often = arguments(**two_outputs(transient_local=True, activity_check_rate=20))
    with running(Process([sys.executable, "-c", WITHOUT_EVENTS, *often])):
        subscriptions = [peer.listen("region", Marker)]
        peer.expect("region")
        peer.wait_until(lambda: peer.node.count_publishers("grid"), "the other output")
        for _ in range(4):
            # A volatile subscriber gets no old message, so the node must have checked in between.
            peer.received.get("grid", []).clear()
            volatile = map_qos(transient_local=False)
            subscriptions.append(peer.listen("grid", OccupancyGrid, volatile))
            peer.expect("grid")
        assert len(peer.received["region"]) == 1
        for subscription in subscriptions:
            peer.node.destroy_subscription(subscription)
        peer.wait_until(lambda: not is_watched(peer), "the node to unsubscribe")


def test_outputs_without_listeners_are_not_made(peer, arguments):
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    order = two_outputs(grid_map_visualizations=["grid", "region"])
    with running_node(MODULE, *arguments(**order)) as node:
        peer.listen("region", Marker)
        peer.wait_until(lambda: publisher.get_subscription_count() == 1, "the node to subscribe")
        # The other output would warn about this map.
        publisher.publish(elevation_map(0.5, layer="height"))
        peer.expect("region")
    assert len(node.lines) == 1, node.text


def test_failing_outputs_are_reported_once_and_others_continue(peer, arguments):
    publisher = peer.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    unshowable = elevation_map(0.5, layer="height")
    malformed = [malformed_map(resolution) for resolution in (-1.0, -2.0, -1.0)]
    with running(Process([sys.executable, "-c", TALKATIVE, *arguments(**two_outputs())])) as node:
        peer.listen("region", Marker)
        peer.listen("grid", OccupancyGrid)
        peer.wait_until(lambda: publisher.get_subscription_count() == 1, "the node to subscribe")
        for count, message in enumerate([unshowable, unshowable, *malformed], start=1):
            publisher.publish(message)
            # The next map would replace one that has not been processed yet.
            peer.wait_until(lambda n=count: node.lines.count("a map\n") == n, f"map {count}")
        peer.expect("region")
        assert not peer.received["grid"]
        publisher.publish(elevation_map(0.5))
        peer.expect("grid")
    start, *problems = [line for line in node.lines if line != "a map\n"]
    assert "shows /grid_map as /region, /grid, while" in start
    unshown, *dropped = problems
    assert "visualization 'grid': no layer 'elevation'; available: height" in unshown
    assert "info.resolution: expected a positive finite number, got -1.0" in dropped[0]
    # Those after it are one line per second.
    assert len(dropped) <= 3
    assert all("info.resolution" in line for line in dropped)


def test_diagnostics_have_the_problems_of_single_outputs(peer, arguments):
    def reported() -> tuple[bytes, str]:
        statuses = [status for report in peer.received["/diagnostics"] for status in report.status]
        return (statuses[-1].level, statuses[-1].message) if statuses else (b"", "")

    with running_node(MODULE, *arguments(**two_outputs())):
        peer.listen("/diagnostics", DiagnosticArray, 10)
        peer.listen("region", Marker)
        grid = peer.listen("grid", OccupancyGrid)
        peer.publish("/grid_map", elevation_map(0.5, layer="height"))
        text = "0 of 1 maps dropped; visualization 'grid': no layer 'elevation'; available: height"
        peer.wait_until(lambda: reported() == (DiagnosticStatus.WARN, text), "the problem")
        peer.publish("/grid_map", elevation_map(0.5))
        text = "0 of 2 maps dropped"
        peer.wait_until(lambda: reported() == (DiagnosticStatus.OK, text), "no problem")
        peer.publish("/grid_map", elevation_map(0.5, layer="height"))
        peer.wait_until(lambda: reported()[0] == DiagnosticStatus.WARN, "the problem")
        peer.node.destroy_subscription(grid)
        text = "0 of 3 maps dropped"
        peer.wait_until(lambda: reported() == (DiagnosticStatus.OK, text), "no subscriber")


def test_resolved_topics_are_logged(peer, arguments):
    words = arguments(**two_outputs(grid_map_topic="terrain"))
    with running_node(MODULE, *words, "-r", "terrain:=/robot/ground", "-r", "grid:=costs") as node:
        peer.wait_until(lambda: node.lines, "the topics")
    assert "shows /robot/ground as /region, /costs, while" in node.text


def test_empty_list_of_visualizations_is_no_error(peer, arguments):
    with running_node(MODULE, *arguments(grid_map_visualizations=[])):
        names = peer.node.get_node_names
        peer.wait_until(lambda: "grid_map_visualization" in names(), "the node")
