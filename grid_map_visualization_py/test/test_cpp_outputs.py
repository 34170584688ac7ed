# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""What the C++ node published for a map is published here too, to the last bit."""

from typing import Any

import pytest
import yaml
from cpp_outputs import FOLDER, recorded, recorded_bytes, recorded_map
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker

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


@pytest.mark.parametrize(("recording", "name"), OUTPUTS)
def test_every_field_is_equal(recording, name):
    message_type, actual = visualized(recording, name)
    if isinstance(actual, bytes):
        actual = deserialize_message(actual, message_type)
    expected = recorded(f"cpp_{recording}/{name}", message_type)
    for field in message_type.get_fields_and_field_types():
        assert getattr(actual, field) == getattr(expected, field), field


@pytest.mark.parametrize(
    ("recording", "name"),
    [("tutorial", "surface_normals"), ("tutorial", "map_region"), ("filters", "surface_normals")],
)
def test_markers_are_equal_byte_by_byte(recording, name):
    message_type, actual = visualized(recording, name)
    assert message_type is Marker
    expected = recorded_bytes(f"cpp_{recording}/{name}")
    assert actual == expected[: len(actual)]
    # Zeros may follow the message.
    assert set(expected[len(actual) :]) <= {0}


@pytest.mark.parametrize(("recording", "name"), OUTPUTS)
def test_publishers_accept_what_visualizations_return(recording, name):
    message_type, actual = visualized(recording, name)
    assert isinstance(actual, bytes) or len(serialize_message(actual)) > 0
    assert isinstance(actual, bytes | message_type)
