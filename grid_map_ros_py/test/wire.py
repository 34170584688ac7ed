# SPDX-License-Identifier: BSD-3-Clause
"""Messages on their way from sender to receiver: serialized by rclpy, or with one field spoilt."""

from typing import Any, TypeVar

from rclpy.serialization import deserialize_message, serialize_message

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
