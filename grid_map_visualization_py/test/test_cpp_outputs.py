# SPDX-License-Identifier: BSD-3-Clause
"""Messages for a map equal those of the C++ node bit by bit."""

import pytest
from messages import recorded_bytes, recorded_map, recorded_parameters

from grid_map_ros_py.messages import serialize
from grid_map_visualization_py import create

PARAMETERS = {recording: recorded_parameters(recording) for recording in ("tutorial", "filters")}
OUTPUTS = [
    (recording, name)
    for recording, parameters in PARAMETERS.items()
    for name in parameters["grid_map_visualizations"]
]


@pytest.mark.parametrize(("recording", "name"), OUTPUTS)
def test_every_output_is_equal_byte_by_byte(recording, name):
    parameters = PARAMETERS[recording]
    grid_map = recorded_map(f"cpp_{recording}{parameters['grid_map_topic']}")
    visualization = create(name, parameters[name])
    actual = visualization(grid_map)
    # Publishers accept both.
    assert isinstance(actual, bytes | visualization.message_type)
    if not isinstance(actual, bytes):
        actual = serialize(actual)
    expected = recorded_bytes(f"cpp_{recording}/{name}")
    assert actual == expected[: len(actual)]
    # Zeros may follow the message.
    assert set(expected[len(actual) :]) <= {0}
