# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Messages for a map equal those of the C++ node bit by bit."""

from typing import Any

import pytest
import yaml
from cpp_outputs import FOLDER, recorded, recorded_bytes, recorded_map
from rclpy.serialization import deserialize_message, serialize_message

from grid_map_ros_py.messages import serialize
from grid_map_visualization_py import create

PARAMETERS = {
    recording: yaml.safe_load((FOLDER / f"{recording}.yaml").read_text())["grid_map_visualization"][
        "ros__parameters"
    ]
    for recording in ("tutorial", "filters")
}
OUTPUTS = [
    (recording, name)
    for recording, parameters in PARAMETERS.items()
    for name in parameters["grid_map_visualizations"]
]


def visualized(recording: str, name: str) -> tuple[type, Any]:
    """Return the type of the output, and the message as this package makes it."""
    parameters = PARAMETERS[recording]
    grid_map = recorded_map(f"cpp_{recording}{parameters['grid_map_topic']}")
    visualization = create(name, parameters[name])
    return visualization.message_type, visualization(grid_map)


def test_every_recorded_output_is_compared():
    for recording, parameters in PARAMETERS.items():
        names = {path.name.partition(".")[0] for path in (FOLDER / f"cpp_{recording}").iterdir()}
        compared = {name for kind, name in OUTPUTS if kind == recording}
        assert names == compared | {parameters["grid_map_topic"].lstrip("/")}
    assert len(OUTPUTS) == 8 + 2


@pytest.mark.parametrize(("recording", "name"), OUTPUTS)
def test_every_field_is_equal(recording, name):
    message_type, actual = visualized(recording, name)
    if isinstance(actual, bytes):
        actual = deserialize_message(actual, message_type)
    expected = recorded(f"cpp_{recording}/{name}", message_type)
    for field in message_type.get_fields_and_field_types():
        assert getattr(actual, field) == getattr(expected, field), field


@pytest.mark.parametrize(("recording", "name"), OUTPUTS)
def test_every_output_is_equal_byte_by_byte(recording, name):
    _, actual = visualized(recording, name)
    if not isinstance(actual, bytes):
        actual = serialize(actual)
    expected = recorded_bytes(f"cpp_{recording}/{name}")
    assert actual == expected[: len(actual)]
    # Zeros may follow the message.
    assert set(expected[len(actual) :]) <= {0}


@pytest.mark.parametrize(("recording", "name"), OUTPUTS)
def test_publishers_accept_messages_of_all_visualizations(recording, name):
    message_type, actual = visualized(recording, name)
    assert isinstance(actual, bytes) or len(serialize_message(actual)) > 0
    assert isinstance(actual, bytes | message_type)
