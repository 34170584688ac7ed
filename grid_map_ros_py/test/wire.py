# SPDX-License-Identifier: BSD-3-Clause
"""Messages on their way to a receiver, serialized or with one field spoilt, and received maps."""

import array
from typing import Any, TypeVar

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float32MultiArray, MultiArrayDimension, MultiArrayLayout

from grid_map_core_py import GridMap
from grid_map_core_py.testing import assert_maps_equal

Message = TypeVar("Message")


def over_the_wire(message: Message) -> Message:
    received: Message = deserialize_message(serialize_message(message), type(message))
    return received


def assert_identical(actual: GridMap, expected: GridMap) -> None:
    """Assert that two maps are equal and store the same bits from the same start index."""
    assert_maps_equal(actual, expected)
    assert actual.start_index == expected.start_index
    for layer in expected:
        assert actual[layer].tobytes("F") == expected[layer].tobytes("F")


def set_field(message: Any, path: str, value: Any) -> None:
    """Set `path` of a message, such as `data[0].layout`, to a value."""
    *parents, last = path.replace("[", ".").replace("]", "").split(".")
    for name in parents:
        message = message[int(name)] if name.isdigit() else getattr(message, name)
    setattr(message, last, value)


def row_major(values: np.ndarray, *, data_offset: int = 0) -> Float32MultiArray:
    """Return a row-major message, built value by value."""
    rows, columns = values.shape
    dim = [
        MultiArrayDimension(label="row_index", size=rows, stride=rows * columns),
        MultiArrayDimension(label="column_index", size=columns, stride=columns),
    ]
    return Float32MultiArray(
        layout=MultiArrayLayout(dim=dim, data_offset=data_offset),
        data=array.array("f", [-1.0] * data_offset + values.ravel("C").tolist()),
    )
