# SPDX-License-Identifier: BSD-3-Clause
"""Messages on their way from sender to receiver: serialized by rclpy, or with one field spoilt."""

import array
from typing import Any, TypeVar

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float32MultiArray, MultiArrayDimension, MultiArrayLayout

Message = TypeVar("Message")


def over_the_wire(message: Message) -> Message:
    received: Message = deserialize_message(serialize_message(message), type(message))
    return received


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
    flat = [float(values[row, column]) for row in range(rows) for column in range(columns)]
    return Float32MultiArray(
        layout=MultiArrayLayout(dim=dim, data_offset=data_offset),
        data=array.array("f", [-1.0] * data_offset + flat),
    )
