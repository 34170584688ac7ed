# SPDX-License-Identifier: BSD-3-Clause
"""The `filter_chain` node as a process, over DDS."""

import copy
import sys

import numpy as np
import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import DescribeParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_sensor_data

from grid_map_core_py import GridMap
from grid_map_core_py.testing import assert_maps_equal, moved_in_buffer
from grid_map_filters_py import FilterChain
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import from_message, to_message
from grid_map_ros_py.nodes import map_qos
from grid_map_ros_py.testing import (
    Peer,
    Process,
    peer,
    refusals,
    running,
    running_node,
    wait_until,
)

MODULE = "grid_map_filters_py._executables.filter_chain"
FILTERS = {
    "filter1": {"name": "normalize", "type": "gridMapFilters/BufferNormalizerFilter"},
    "filter2": {
        "name": "inpaint",
        "type": "gridMapCv/InpaintFilter",
        "params": {"input_layer": "elevation", "output_layer": "filled", "radius": 1},
    },
    "filter3": {
        "name": "mean",
        "type": "gridMapFilters/MeanInRadiusFilter",
        "params": {"input_layer": "filled", "output_layer": "smooth", "radius": 1},
    },
    "filter4": {
        "name": "roughness",
        "type": "gridMapFilters/MathExpressionFilter",
        "params": {"output_layer": "roughness", "expression": "abs(filled - smooth)"},
    },
}


@pytest.fixture
def parameters(tmp_path):
    """Return a function that writes a parameter file and returns the arguments that load it."""

    def write(filters=FILTERS, file="parameters.yaml", **others):
        path = tmp_path / file
        content = {"grid_map_filters": {"ros__parameters": {"filters": filters, **others}}}
        path.write_text(yaml.safe_dump(content))
        return ["--ros-args", "--params-file", str(path)]

    return write


@pytest.fixture
def other_side():
    with peer() as other:
        other.listen("/filtered_map", GridMapMessage)
        yield other


def terrain(
    size=(12, 7), start=(0, 0), holes=((3, 4), (11, 6)), timestamp=1_500_000_001
) -> GridMap:
    """Return a slope with holes, stored from any start index."""
    values = np.fromfunction(lambda i, j: 0.3 * i + np.sin(j), size).astype(np.float32)
    for hole in holes:
        values[hole] = np.nan
    grid_map = GridMap(
        np.multiply(size, 0.5),
        0.5,
        (3.0, -2.0),
        {"elevation": values},
        frame_id="odom",
        timestamp=timestamp,
    )
    return moved_in_buffer(grid_map, start)


def filtered(other: Peer, message: GridMapMessage, count: int) -> GridMap:
    """Send a map and return message number `count` of the result."""
    other.publish("/grid_map", message)
    return from_message(other.expect("/filtered_map", count))


@pytest.mark.filterwarnings("ignore:.*no finite cell:grid_map_filters_py.FilterWarning")
def test_results_equal_the_library(parameters, other_side):
    empty = GridMap((2.0, 3.0), 0.5, layers=["elevation"], frame_id="odom")
    worlds = [terrain(), terrain((5, 16), holes=[(0, 0)]), empty]
    with running_node(MODULE, *parameters()):
        count = 0
        for world in worlds:
            expected = FilterChain.from_config(FILTERS)(world)
            for start in [(0, 0), tuple(np.subtract(world.size, 1)), (2, 3)]:
                count += 1
                sent = to_message(moved_in_buffer(world, start))
                result = filtered(other_side, sent, count)
                assert_maps_equal(result, expected)
                # The first filter makes a copy in map order.
                assert other_side.received["/filtered_map"][-1].outer_start_index == 0
                assert result.layers == ("elevation", "filled", "smooth", "roughness")


def test_late_nodes_and_subscribers_get_the_last_map(parameters, other_side):
    latched = other_side.node.create_publisher(GridMapMessage, "/grid_map", map_qos())
    latched.publish(to_message(terrain(timestamp=1)))
    with running_node(MODULE, *parameters()) as node:
        assert from_message(other_side.expect("/filtered_map")).timestamp == 1
        # A volatile publisher.
        other_side.publish("/grid_map", to_message(terrain(timestamp=2)), 1)
        other_side.expect("/filtered_map", 2)
        with peer() as late:
            late.listen("/filtered_map", GridMapMessage)
            assert from_message(late.expect("/filtered_map")).timestamp == 2
        other_side.node.create_publisher(GridMapMessage, "/grid_map", qos_profile_sensor_data)
        text = "no messages from a publisher of /grid_map: incompatible quality of service"
        wait_until(lambda: text in node.text, "the warning")


@pytest.mark.needs("numba")
def test_first_start_logs_that_it_compiles(parameters, tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    params = {"input_layer": "elevation", "output_layer": "curvature"}
    step = {"name": "curvature", "type": "gridMapFilters/CurvatureFilter", "params": params}
    for times in (1, 0):
        with running_node(MODULE, *parameters({"filter1": step})) as node:
            wait_until(lambda: "[INFO]" in node.text and " on /grid_map" in node.text, "the start")
            assert node.text.count("]: numba compiles loops once") == times


MALFORMED = [
    ("data", [], "data: expected 1 arrays, one for each of layers"),
    ("outer_start_index", 12, "outer_start_index: expected 0 to 11, got 12"),
    ("basic_layers", ["nothing"], "basic_layers[0]: expected one of ['elevation'], got 'nothing'"),
]
"""Fields, wrong values and the errors; the tests of messages have all kinds."""


def test_malformed_maps_are_named_and_the_next_is_filtered(parameters, other_side):
    with running_node(MODULE, *parameters()) as node:
        for field, value, text in MALFORMED:
            message = to_message(terrain())
            setattr(message, field, value)
            other_side.publish("/grid_map", message)
            wait_until(lambda text=text: text in node.text, f"{text!r} in the log")
        other_side.publish("/grid_map", to_message(without_elevation()))
        wait_until(lambda: NO_ELEVATION in node.text, "the missing layer in the log")
        assert not other_side.received["/filtered_map"]
        result = filtered(other_side, to_message(terrain()), 1)
        assert_maps_equal(result, FilterChain.from_config(FILTERS)(terrain()))


NO_ELEVATION = (
    "filter 2 'inpaint' (gridMapCv/InpaintFilter): no layer 'elevation'; available: height"
)


def without_elevation() -> GridMap:
    return GridMap((1.0, 1.0), 0.5, layers={"height": 1.0}, frame_id="odom")


# --- statistics -----------------------------------------------------------------------------------


def test_diagnostics_count_maps_and_time_every_step(parameters, other_side):
    other_side.listen("/diagnostics", DiagnosticArray, 10)

    def expect(**counts: str) -> tuple[DiagnosticStatus, dict[str, str]]:
        """Wait for a report with these values, `maps_in="1"` for "maps in"."""
        wanted = {key.replace("_", " "): value for key, value in counts.items()}
        found = []

        def has_come() -> bool:
            for report in other_side.received["/diagnostics"][-1:]:
                values = {value.key: value.value for value in report.status[0].values}
                found[:] = report.status[0], values
            return bool(found) and wanted.items() <= found[1].items()

        other_side.wait_until(has_come, f"diagnostics with {wanted}")
        assert found[0].name == "grid_map_filters"
        return found

    with running_node(MODULE, *parameters()):
        # Reports are published without maps, too.
        status, _ = expect(maps_in="0", maps_out="0", maps_dropped="0")
        assert status.level == DiagnosticStatus.OK
        other_side.publish("/grid_map", to_message(without_elevation()))
        status, values = expect(maps_in="1", maps_out="0", maps_dropped="1")
        assert (status.level, status.message) == (DiagnosticStatus.WARN, "1 of 1 maps dropped")
        assert values["last error"] == NO_ELEVATION
        for count in (1, 2):
            filtered(other_side, to_message(terrain()), count)
        status, values = expect(maps_in="3", maps_out="2", maps_dropped="1")
        assert status.level == DiagnosticStatus.OK
        for kind in ("ms", "mean ms", "max ms"):
            steps = [key for key in values if key.startswith(f"{kind} ")]
            assert steps == [f"{kind} {step['name']}" for step in FILTERS.values()]
            assert all(float(values[step]) >= 0 for step in steps)
        assert {"ms", "mean ms"} <= values.keys()
        assert set_all(other_side, filter4={"name": "rough"}) == OK
        filtered(other_side, to_message(terrain()), 3)
        _, values = expect(maps_in="4", maps_out="3")
        assert ("ms rough" in values, "ms roughness" in values) == (True, False)


# --- parameters that change -----------------------------------------------------------------------


def request(other: Peer, service: type, changes: dict[str, object]):
    """Set parameters of the node by a service; None deletes a parameter."""
    name = {SetParameters: "set_parameters", SetParametersAtomically: "set_parameters_atomically"}
    client = other.node.create_client(service, f"/grid_map_filters/{name[service]}")
    other.wait_until(client.service_is_ready, name[service])
    parameters = [Parameter(key, value=value).to_parameter_msg() for key, value in changes.items()]
    future = client.call_async(service.Request(parameters=parameters))
    other.wait_until(future.done, "an answer")
    other.node.destroy_client(client)
    return future.result()


def set_one(other: Peer, name: str, value: object) -> tuple[bool, str]:
    (result,) = request(other, SetParameters, {name: value}).results
    return result.successful, result.reason


def set_all(other: Peer, **steps: dict[str, object]) -> tuple[bool, str]:
    """Set parameters below `filters` atomically: `filter2={"params.radius": 1.0}`."""
    changes = {
        f"filters.{step}.{key}": value
        for step, parameters in steps.items()
        for key, value in parameters.items()
    }
    result = request(other, SetParametersAtomically, changes).result
    return result.successful, result.reason


OK = (True, "")


def test_new_parameter_value_applies_to_the_next_map(parameters, other_side):
    message, radius = to_message(terrain()), "filters.filter3.params.radius"
    wrong = {"filters.filter2.params.radius": -1.0}, {"use_sim_time": "yes"}
    reasons = "filter 2 'inpaint'", "Wrong parameter type"
    with running_node(MODULE, *parameters()):
        before = filtered(other_side, message, 1)
        for change, reason in zip(wrong, reasons, strict=True):
            result = request(other_side, SetParametersAtomically, {radius: 2.25} | change).result
            assert not result.successful
            assert reason in result.reason
        assert_maps_equal(filtered(other_side, message, 2), before)
        # The file gives this value as an integer.
        results = request(other_side, SetParameters, {radius: 2.25} | wrong[0]).results
        assert [result.successful for result in results] == [True, False]
        config = copy.deepcopy(FILTERS)
        config["filter3"]["params"]["radius"] = 2.25
        after = filtered(other_side, message, 3)
        assert_maps_equal(after, FilterChain.from_config(config)(terrain()))
        assert not np.array_equal(before["smooth"], after["smooth"])
        # This parameter is not in the file.
        changes = {radius: 1, "use_sim_time": True}
        result = request(other_side, SetParametersAtomically, changes).result
        assert (result.successful, result.reason) == OK
        assert_maps_equal(filtered(other_side, message, 4), before)


# Values that a chain refuses, and those that only a node can get; tests of chains have more.
WRONG = {
    "filters.filter3.params.radius": (
        -1.0,
        (
            "filter 3 'mean' (gridMapFilters/MeanInRadiusFilter): "
            "parameter 'radius': expected a length >= 0 [m], got -1.0"
        ),
    ),
    "filters.filter2.params.radius": (
        "wide",
        (
            "filter 2 'inpaint' (gridMapCv/InpaintFilter): "
            "parameter 'radius': expected a number, got 'wide' (str)"
        ),
    ),
    "filters.filter3.params.input_layer": (None, "missing parameter 'input_layer'"),
    "filters.filter5.name": ("last", "filter 5: type: expected a string, got nothing"),
    "filters.filter3": (1, "filter3"),
    f"filters.filter1.params.{'x.' * 3000}y": (1, "expected at most 50 nested levels, got 3003"),
    f"filters.filter{'1' * 5000}.name": ("a", "filters: expected filter1 .. filterN, got 'filter1"),
    "filters.fliter3.name": ("a", "filters: expected filter1 .. filterN, got 'fliter3'"),
    "filters": ("x", "unknown parameter 'filters'; those that can be set begin with 'filters.'"),
    "inptu_topic": ("/a", "unknown parameter 'inptu_topic'"),
    "input_topic": ("/a", "read-only parameter: input_topic"),
    "output_topic": ("/a", "read-only parameter: output_topic"),
    "filter_chain_parameter_name": ("b", "read-only parameter: filter_chain_parameter_name"),
    "threads": (2, "read-only parameter: threads"),
}


def test_wrong_value_is_refused_and_the_old_chain_stays(parameters, other_side):
    message = to_message(terrain())
    with running_node(MODULE, *parameters()) as node:
        before = filtered(other_side, message, 1)
        for name, (value, reason) in WRONG.items():
            successful, found = set_one(other_side, name, value)
            assert not successful, name
            assert reason in found, name
        assert_maps_equal(filtered(other_side, message, 2), before)
        assert "Traceback" not in node.text
        assert "now FilterChain" not in node.text


FAILING = """
from grid_map_filters_py._executables import filter_chain

def nested(values):
    raise KeyError('of a plug-in')

filter_chain.nested = nested
raise SystemExit(filter_chain.FilterChainNode.main())
"""


def test_parameter_is_refused_whatever_its_chain_raises(parameters, other_side):
    reason = "KeyError('of a plug-in')"
    with running(Process([sys.executable, "-c", FAILING, *parameters()])) as node:
        assert set_one(other_side, "filters.filter3.params.radius", 2.25) == (False, reason)
        assert filtered(other_side, to_message(terrain()), 1).layers
        other_side.wait_until(lambda: f"set_parameters: {reason}" in node.text, "a line")


def test_filters_are_added_replaced_and_removed_while_maps_flow(parameters, other_side):
    message = to_message(terrain())
    delete = {"name": "tidy", "type": "Deletion", "params.layers": ["smooth", "filled"]}
    threshold = {"name": "cut", "type": "Threshold", "params.layer": "roughness"}
    threshold |= {"params.upper_threshold": 0.1, "params.set_to": 0}
    with running_node(MODULE, *parameters()):
        first = filtered(other_side, message, 1)
        assert set_all(other_side, filter5=delete) == OK
        assert filtered(other_side, message, 2).layers == ("elevation", "roughness")
        gone = dict.fromkeys(delete)
        assert set_all(other_side, filter5={**gone, **threshold}) == OK
        result = filtered(other_side, message, 3)
        assert result.layers == first.layers
        assert result["roughness"].max() < 0.1 < first["roughness"].max()
        assert set_all(other_side, filter5=dict.fromkeys(threshold)) == OK
        assert_maps_equal(filtered(other_side, message, 4), first)
        successful, reason = set_all(other_side, filter1=dict.fromkeys(("name", "type")))
        assert (successful, reason) == (False, "filters: filter1 is missing before filter2")
        for missing in ("filters.filter9.name", "input_topics"):
            refusal = f"no parameter {missing!r} to delete"
            assert set_one(other_side, missing, None) == (False, refusal)


def test_empty_list_parameter_can_be_filled(parameters, other_side):
    """An empty list in a parameter file has no type in ROS."""
    tidy = {"name": "tidy", "type": "gridMapFilters/DeletionFilter", "params": {"layers": []}}
    message = to_message(without_elevation())
    with running_node(MODULE, *parameters({"filter1": tidy})):
        assert filtered(other_side, message, 1).layers == ("height",)
        assert set_one(other_side, "filters.filter1.params.layers", ["height"]) == OK
        assert filtered(other_side, message, 2).layers == ()


def test_each_parameter_of_the_chain_has_its_own_description(parameters, other_side):
    names = {
        "filters.filter2.name": "name of filter2",
        "filters.filter2.type": "type of filter2",
        "filters.filter2.params.radius": "radius of the neighborhood",
        "filters.filter3.params.radius": "radius of the disc [m]",
    }
    with running_node(MODULE, *parameters()):
        client = other_side.node.create_client(
            DescribeParameters, "/grid_map_filters/describe_parameters"
        )
        other_side.wait_until(client.service_is_ready, "describe_parameters")
        future = client.call_async(DescribeParameters.Request(names=[*names]))
        other_side.wait_until(future.done, "an answer")
    for descriptor, expected in zip(future.result().descriptors, names.values(), strict=True):
        assert descriptor.description.startswith(expected)


# --- topics ---------------------------------------------------------------------------------------


def test_topics_and_the_name_of_the_chain_are_parameters(tmp_path, other_side):
    path = tmp_path / "parameters.yaml"
    content = {
        "input_topic": "/in",
        "output_topic": "/out",
        "filter_chain_parameter_name": "my_filters",
        "my_filters": FILTERS,
        "threads": 2,
    }
    path.write_text(yaml.safe_dump({"/**": {"ros__parameters": content}}))
    other_side.listen("/out", GridMapMessage)
    with running_node(MODULE, "--ros-args", "--params-file", str(path)):
        other_side.publish("/in", to_message(terrain()))
        other_side.expect("/out")


def test_the_result_keeps_the_start_index_without_a_normalizer(parameters, other_side):
    with running_node(MODULE, *parameters({"filter1": FILTERS["filter2"]})):
        other_side.publish("/grid_map", to_message(terrain(start=(3, 5))))
        message = other_side.expect("/filtered_map")
    assert (message.outer_start_index, message.inner_start_index) == (3, 5)
    assert_maps_equal(
        from_message(message), FilterChain.from_config([FILTERS["filter2"]])(terrain())
    )


REFUSED = [
    ({"filters": {}}, "filters: expected at least one filter, got none"),
    ({"filters": {"filter2": FILTERS["filter2"]}}, "filter1 is missing before filter2"),
    ({"input_topic": "/a", "output_topic": "a"}, "input_topic and output_topic are both '/a'"),
    ({"input_topic": "a b"}, "input_topic"),
    ({"input_topic": ""}, "input_topic"),
    ({"input_topic": "/a//b"}, "input_topic"),
]
"""Parameters, and a part of the message."""


def test_wrong_parameters_end_the_node_with_one_message(parameters):
    main = f"{MODULE}:FilterChainNode.main"
    given = [parameters(file=f"{k}.yaml", **wrong) for k, (wrong, _) in enumerate(REFUSED)]
    messages = refusals([(main, words) for words in given])
    for message, (_, text) in zip(messages, REFUSED, strict=True):
        assert message.count(text) == 1
        assert "[grid_map_filters]: " in message


def test_map_beyond_the_limit_of_cells_is_dropped(other_side, parameters):
    reason = "info: expected at most 100 cells, got 12 x 12"
    with running_node(MODULE, *parameters(max_cells=100)) as node:
        other_side.publish("/grid_map", to_message(terrain((12, 12))))
        other_side.wait_until(lambda: reason in node.text, "the map to be dropped")
        assert filtered(other_side, to_message(terrain()), 1).layers
    assert "dropped a message of /grid_map" in node.text
