# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Parameters from real files, read by a real node."""

import json
from pathlib import Path
from typing import Any

import pytest

from conftest import Start
from grid_map_ros_py.testing import Process, wait_until

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
            "set_to": "NaN",
            "lower": float("-inf"),
            "on": True,
            "weights": [1.0, 2.5],
        },
    },
    "filter10": {"name": "last"},
}


def arguments(folder: Path, text: str, node: str = "configured") -> list[str]:
    path = folder / "parameters.yaml"
    path.write_text(f"{node}:\n  ros__parameters:\n{text}")
    return ["--ros-args", "--params-file", str(path)]


def read(process: Process) -> Any:
    wait_until(lambda: process.lines, "what the node has read")
    # NaN equals nothing, not even itself.
    return json.loads(
        process.lines[0], parse_constant=lambda name: name if name == "NaN" else float(name)
    )


def failure(process: Process) -> str:
    assert process.wait() == 1
    assert "Traceback" not in process.text
    return process.text


@pytest.mark.parametrize("node", ["configured", "/**"])
def test_parameter_file_may_name_the_node_in_any_way(
    start: Start, tmp_path: Path, node: str
) -> None:
    found = read(start("configured.py", *arguments(tmp_path, CHAIN + "    frame_id: map\n", node)))
    assert found["tree"] == TREE
    assert (found["rate"], found["color"], found["names"]) == (2.0, 0, ["default"])
    described = {"rate": "how often", "color": "", "filters.filter1.name": "what runs"}
    assert found["descriptions"] == described
    assert found["declared"] == {
        "filter_chain_parameter_name": "STRING",
        "rate": "DOUBLE",
        "color": "INTEGER",
        "names": "STRING_ARRAY",
        "frame_id": "STRING",
        "filters.filter1.name": "STRING",
        "filters.filter1.type": "STRING",
        "filters.filter2.name": "STRING",
        "filters.filter2.type": "STRING",
        "filters.filter2.params.input_layer": "STRING",
        "filters.filter2.params.min/value": "DOUBLE",
        "filters.filter2.params.max/value": "INTEGER",
        "filters.filter2.params.max.color": "DOUBLE",
        "filters.filter2.params.layers": "STRING_ARRAY",
        "filters.filter2.params.none": "NOT_SET",
        "filters.filter2.params.empty": "STRING",
        "filters.filter2.params.set_to": "DOUBLE",
        "filters.filter2.params.lower": "DOUBLE",
        "filters.filter2.params.on": "BOOL",
        "filters.filter2.params.weights": "DOUBLE_ARRAY",
        "filters.filter10.name": "STRING",
    }


def test_numbers_are_read_as_the_requested_type(start: Start, tmp_path: Path) -> None:
    text = "    rate: 3\n    color: 255.0\n    names: []\n    frame_id: ''\n"
    found = read(start("configured.py", *arguments(tmp_path, text)))
    assert (found["rate"], found["color"]) == (3.0, 255)
    assert isinstance(found["rate"], float)
    assert isinstance(found["color"], int)
    assert (found["names"], found["frame_id"]) == ([], "")
    assert found["declared"]["rate"] == "DOUBLE"
    assert found["tree"] == {}


def test_command_line_wins_and_the_prefix_can_be_chosen(start: Start, tmp_path: Path) -> None:
    text = "    frame_id: map\n    chain.filter1.name: a\n    chains.filter1.name: b\n"
    options = ["-p", "frame_id:=odom", "-p", "filter_chain_parameter_name:=chain"]
    found = read(start("configured.py", *arguments(tmp_path, text), *options))
    assert found["tree"] == {"filter1": {"name": "a"}}
    assert found["declared"].keys() >= {"chain.filter1.name"}
    assert "chains.filter1.name" not in found["declared"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("    rate: 1\n", "parameter 'frame_id': expected a string, got nothing"),
        ("    rate: fast\n", "parameter 'rate': expected a number, got 'fast' (str)"),
        (
            "    names: map\n",
            "parameter 'names': expected a list, each item a string, got 'map' (str)",
        ),
        (
            "    frame_id: y\n",
            "expected a string (quote it), got True (bool)",
        ),
        ("    filters: 3\n", "parameter 'filters': expected parameters below it, got 3 (int)"),
        (
            "    filters: {a: 1, a.b: 2}\n",
            "'filters.a': expected no value, as there are parameters below it, got 1 (int)",
        ),
        (
            "    filters: {a.b: 1, a: 2}\n",
            "'filters.a': expected no value, as there are parameters below it, got 2 (int)",
        ),
    ],
)
def test_wrong_parameter_stops_the_node_with_one_message(
    start: Start, tmp_path: Path, text: str, message: str
) -> None:
    errors = failure(start("configured.py", *arguments(tmp_path, text)))
    assert message in errors
    assert errors.count("\n") == 1


def test_unreadable_parameter_file_stops_the_node_with_a_message(
    start: Start, tmp_path: Path
) -> None:
    missing = str(tmp_path / "missing.yaml")
    assert missing in failure(start("configured.py", "--ros-args", "--params-file", missing))
