# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of real files and of the command line, read by a real node."""

import copy
import math
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from grid_map_core_py import ConfigError
from grid_map_ros_py.nodes import ConfiguredNode, read_parameter, read_parameter_tree
from grid_map_ros_py.testing import environment

CHAIN = """
    filters:
      filter1:
        name: buffer_normalizer
        type: gridMapFilters/BufferNormalizerFilter
      filter2:
        name: ramp
        type: gridMapFilters/ColorMapFilter
        params:
          input_layer: elevation
          min/value: 0.5
          max/value: 1
          max: {color: 1e-3}
          layers: [a, b]
          none: []
          empty: ""
          set_to: .nan
          lower: -.inf
          on: true
          weights: [1.0, 2.5]
      filter10: {name: last}
"""

TREE = {
    "filter1": {"name": "buffer_normalizer", "type": "gridMapFilters/BufferNormalizerFilter"},
    "filter2": {
        "name": "ramp",
        "type": "gridMapFilters/ColorMapFilter",
        "params": {
            "input_layer": "elevation",
            "min/value": 0.5,
            "max/value": 1,
            "max": {"color": 0.001},
            "layers": ["a", "b"],
            "none": None,
            "empty": "",
            "lower": float("-inf"),
            "on": True,
            "weights": [1.0, 2.5],
        },
    },
    "filter10": {"name": "last"},
}


TYPES = {
    "filter1.name": "STRING",
    "filter2.params.max/value": "INTEGER",
    "filter2.params.max.color": "DOUBLE",
    "filter2.params.layers": "STRING_ARRAY",
    "filter2.params.none": "NOT_SET",
    "filter2.params.on": "BOOL",
    "filter2.params.weights": "DOUBLE_ARRAY",
}

Start = Callable[..., ConfiguredNode]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Function that starts a node with the text of a parameter file and further arguments."""
    path = tmp_path / "parameters.yaml"
    with patch.dict(os.environ, environment(), clear=True), ExitStack() as stack:

        def start_node(text: str, *arguments: str, name: str = "configured") -> ConfiguredNode:
            path.write_text(f"{name}:\n  ros__parameters:\n{text}")
            given = ["--ros-args", "--params-file", str(path), *arguments]
            context = Context()
            rclpy.init(context=context)
            stack.callback(rclpy.shutdown, context=context)
            node = ConfiguredNode("configured", context=context, cli_args=given)
            stack.callback(node.destroy_node)
            return node

        yield start_node


def declared(node: Node) -> dict[str, str]:
    """Return the types of the declared parameters, without those of every node."""
    return {
        name: parameter.type_.name
        for name, parameter in node.get_parameters_by_prefix("").items()
        if not name.startswith(("use_sim_time", "start_type", "max_"))
    }


@pytest.mark.parametrize("name", ["configured", "/**"])
def test_tree_of_parameters_is_read_described_and_declared(start: Start, name: str) -> None:
    node = start(CHAIN, name=name)
    trees = []

    def describe(tree):
        trees.append(copy.deepcopy(tree))
        return {"filter1.name": "name of a step"}

    found = read_parameter_tree(node, "filters", description="what runs", describe=describe)
    assert str(trees) == str([found])
    # NaN equals nothing, not even itself.
    assert math.isnan(found["filter2"]["params"].pop("set_to"))
    assert found == TREE
    types = declared(node)
    assert {name: types[f"filters.{name}"] for name in TYPES} == TYPES
    assert len(types) == 16
    assert node.describe_parameter("filters.filter1.name").description == "name of a step"
    assert node.describe_parameter("filters.filter1.type").description == "what runs"


def test_parameters_without_value_in_the_file_have_their_default(start: Start) -> None:
    node = start("    other: 1\n")
    assert read_parameter(node, "rate", float, 2.0, description="how often") == 2.0
    assert read_parameter(node, "names", list[str], ["default"]) == ["default"]
    assert read_parameter_tree(node, "filters") == {}
    assert declared(node) == {"rate": "DOUBLE", "names": "STRING_ARRAY"}
    assert node.describe_parameter("rate").description == "how often"


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [("3", float, 3.0), ("255.0", int, 255), ("[]", list[str], []), ("''", str, "")],
)
def test_value_has_the_requested_type(start: Start, text: str, kind: Any, expected: Any) -> None:
    found = read_parameter(start(f"    value: {text}\n"), "value", kind)
    assert (found, type(found)) == (expected, type(expected))


def test_command_line_wins_over_the_file(start: Start) -> None:
    text = "    frame_id: map\n    chain.filter1.name: a\n    chains.filter1.name: b\n"
    node = start(text, "-p", "frame_id:=odom")
    assert read_parameter(node, "frame_id", str) == "odom"
    # Other names may begin with the prefix.
    assert read_parameter_tree(node, "chain") == {"filter1": {"name": "a"}}
    assert "chains.filter1.name" not in declared(node)


@pytest.mark.parametrize(
    ("text", "kind", "message"),
    [
        ("other: 1", str, "expected a string, got nothing"),
        ("value: fast", float, r"expected a number, got 'fast' \(str\)"),
        ("value: map", list[str], r"expected a list, each item a string, got 'map' \(str\)"),
        ("value: y", str, r"expected a string \(quote it\), got True \(bool\)"),
    ],
)
def test_value_of_another_type_is_refused(start: Start, text: str, kind: Any, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^parameter 'value': {message}$"):
        read_parameter(start(f"    {text}\n"), "value", kind)


@pytest.mark.parametrize(
    ("value", "name", "found"),
    [
        ("3", "filters", "3"),
        ("{a: 1, a.b: 2}", "filters.a", "1"),
        ("{a.b: 1, a: 2}", "filters.a", "2"),
    ],
)
def test_value_above_other_parameters_is_refused(start: Start, value, name, found) -> None:
    with pytest.raises(ConfigError, match=rf"'{name}': expected .* below it, got {found} \(int\)"):
        read_parameter_tree(start(f"    filters: {value}\n"), "filters")


@pytest.mark.parametrize("value", ["0.0", "-1.0", "1.0e+10", ".nan"])
def test_rates_must_be_positive(start: Start, value: str) -> None:
    with pytest.raises(ConfigError, match="'rate': expected a positive number from 1e-09 to 1e"):
        start(f"    rate: {value}\n").read_positive("rate", 1.0, "how often")


def test_topics_must_have_valid_names(start: Start) -> None:
    node = start("    input: 'no topic'\n    none: ''\n")
    assert (node.read_topic("none", "", ""), node.read_topic("output", "map", "")) == ("", "map")
    with pytest.raises(ConfigError, match="'input': expected the name of a topic, got 'no topic'"):
        node.read_topic("input", "/grid_map", "")
