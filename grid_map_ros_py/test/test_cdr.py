# SPDX-License-Identifier: BSD-3-Clause
"""Serialization and views agree with rclpy."""

import importlib
import struct
from typing import Any

import numpy as np
import pytest
from cpp_recordings import bits
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point
from hypothesis import given, settings, strategies as st
from nav_msgs.msg import GridCells, OccupancyGrid, Odometry
from rcl_interfaces.msg import ParameterDescriptor, ParameterEvent
from rclpy.serialization import deserialize_message, serialize_message
from rosidl_parser import definition
from sensor_msgs.msg import CameraInfo, JointState, PointCloud2
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import ColorRGBA, Empty, Header, Int16MultiArray, UInt64MultiArray
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import InteractiveMarker, Marker

from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import MessageError
from grid_map_ros_py.messages import serialize, view

TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9)


def assert_encodes(actual: bytes, message: object, at_the_end: int = 8) -> None:
    """Assert that `actual` equals the serialized `message`, except for padding."""
    expected = serialize_message(message)
    # rclpy leaves padding undefined, and for empty sequences it adds a few bytes at the end.
    assert 0 <= len(expected) - len(actual) <= at_the_end
    assert all(byte in (other, 0) for byte, other in zip(actual, expected, strict=False))
    assert bits(deserialize_message(actual, type(message))) == bits(message)


def big_endian(message: Any) -> bytes:
    """Return a message in big-endian CDR, written by an independent encoder."""
    return b"\0\0\0\0" + bytes(_append(bytearray(), message))


def _append(out: bytearray, value: Any, kind: str = "") -> bytearray:
    codes = {"double": "d", "float": "f", "int32": "i", "uint32": "I", "uint16": "H"}
    codes |= {"uint8": "B", "int8": "b", "boolean": "?"}
    if kind in codes:
        size = struct.calcsize(">" + codes[kind])
        out += bytes(-len(out) % size) + struct.pack(">" + codes[kind], value)
    elif kind == "string":
        _append(out, len(value.encode()) + 1, "uint32").extend(value.encode() + b"\0")
    elif kind.startswith("sequence<"):
        _append(out, len(value), "uint32")
        for item in value:
            _append(out, item, kind[len("sequence<") : -1])
    elif kind.endswith("]"):
        for item in value:
            _append(out, item, kind.partition("[")[0])
    else:
        for name, field_kind in value.get_fields_and_field_types().items():
            _append(out, getattr(value, name), field_kind)
    return out


@given(TEXTS, TEXTS, st.integers(0, 4))
def test_marker_does_not_depend_on_alignment(frame_id, namespace, count):
    random = np.random.default_rng(count)
    points, colors = random.random((count, 3)), random.random((count, 4), np.float32)
    marker = Marker(ns=namespace, text=frame_id, id=-7, frame_locked=True)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in points.tolist()]
    marker.colors = [ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in colors.tolist()]
    marker.header.frame_id = frame_id
    marker.texture.data = b"abc"
    marker.mesh_file.filename = "mesh"
    assert_encodes(serialize(marker, {"points": points, "colors": colors}), marker)
    message = JointState(name=["first", "second"], position=[1.5], effort=points.ravel().tolist())
    assert_encodes(serialize(message, {"effort": points.ravel()}), message)


def test_field_that_the_message_lacks_is_refused():
    with pytest.raises(AttributeError, match="pionts"):
        serialize(Marker(), {"pionts": np.zeros((1, 3))})


# --- any message ----------------------------------------------------------------------------------

MESSAGE_TYPES = (
    GridMapMessage,
    CameraInfo,
    DiagnosticArray,
    Empty,
    GridCells,
    Int16MultiArray,
    InteractiveMarker,
    JointTrajectory,
    Marker,
    OccupancyGrid,
    Odometry,
    ParameterDescriptor,
    ParameterEvent,
    PointCloud2,
    SetBool.Response,
    SolidPrimitive,
    UInt64MultiArray,
)
"""Among them: every type of number, booleans and bytes in sequences, bounded texts and sequences,
arrays of numbers, a message without fields, and messages five deep."""


@st.composite
def messages(draw: st.DrawFn, message_type: type) -> Any:
    """Draw a message with any values that its types allow."""
    message = message_type()
    for name, kind in zip(
        message.get_fields_and_field_types(), message_type.SLOT_TYPES, strict=True
    ):
        setattr(message, name, draw(values(kind)))
    return message


NUMBERS = {
    "boolean": st.booleans(),
    "octet": st.binary(min_size=1, max_size=1),
    "float": st.floats(width=32),
    "double": st.floats(),
    **{f"uint{n}": st.integers(0, 2**n - 1) for n in (8, 16, 32, 64)},
    **{f"int{n}": st.integers(-(2 ** (n - 1)), 2 ** (n - 1) - 1) for n in (8, 16, 32, 64)},
}


def values(kind: Any) -> st.SearchStrategy[Any]:
    if isinstance(kind, definition.NamespacedType):
        module = importlib.import_module(".".join(kind.namespaces))
        return messages(getattr(module, kind.name))
    if isinstance(kind, definition.AbstractString):
        return TEXTS
    if isinstance(kind, definition.Array):
        return st.lists(values(kind.value_type), min_size=kind.size, max_size=kind.size)
    if isinstance(kind, definition.AbstractSequence):
        most = kind.maximum_size if kind.has_maximum_size() else 3
        return st.lists(values(kind.value_type), max_size=most)
    return NUMBERS[kind.typename]


@settings(max_examples=15)
@pytest.mark.parametrize("message_type", MESSAGE_TYPES, ids=lambda kind: kind.__name__)
@given(data=st.data())
def test_every_message_is_read_as_rclpy_reads_it(message_type, data):
    message = data.draw(messages(message_type))
    raw = serialize_message(message)
    assert_encodes(serialize(message), message, at_the_end=len(raw))
    read = serialize(view(raw, message_type), message_type=message_type)
    assert read == serialize(message)


@settings(max_examples=15)
@pytest.mark.parametrize("message_type", MESSAGE_TYPES, ids=lambda kind: kind.__name__)
@given(data=st.data())
def test_every_truncated_message_is_refused(message_type, data):
    raw = serialize(data.draw(messages(message_type)))
    length = data.draw(st.integers(0, len(raw) - 1))
    with pytest.raises(MessageError) as refused:
        view(raw[:length], message_type)
    assert refused.value.field


@settings(max_examples=15)
@pytest.mark.parametrize("message_type", [GridMapMessage, Marker, OccupancyGrid, Odometry])
@given(data=st.data())
def test_big_endian_messages_are_read_like_little_endian_ones(message_type, data):
    message = data.draw(messages(message_type))
    read = serialize(view(big_endian(message), message_type), message_type=message_type)
    assert read == serialize(message)


def test_view_shares_the_memory_of_the_bytes():
    raw = bytearray(serialize_message(Int16MultiArray(data=[1, 2, 3])))
    data = view(raw, Int16MultiArray).data
    raw[-2:] = b"\x09\x00"
    assert data.tolist() == [1, 2, 9]


@pytest.mark.parametrize(
    ("spoil", "text"),
    [
        (lambda raw: raw[:2], "encoding: expected 4 bytes, got 2"),
        *(
            (lambda raw, code=code: code + raw[2:],
             f"encoding: expected plain CDR (0x0000 or 0x0001), got '0x{code.hex()}'")
            for code in (b"\0\3", b"\0\x0b", b"\1\0")
        ),
        (lambda raw: raw[:10], "header.stamp.nanosec: expected 4 bytes more, got 2"),
        (lambda raw: raw.replace(b"\4\0\0\0map", b"\4\0\0\xffmap"),
         "header.frame_id: expected at most 68 values (68 bytes more), got 4278190084"),
        (lambda raw: raw.replace(b"map", b"m\xffp"),
         "header.frame_id: expected a text in UTF-8, got b'm\xffp'"),
        (lambda raw: raw.replace(b"map", b"m\0p"),
         "header.frame_id: expected a text without NUL, got 'm\x00p'"),
        (lambda raw: raw[:-1], "cells[1].z: expected 8 bytes more, got 7"),
    ],
)  # fmt: skip
def test_errors_name_the_field(spoil, text):
    raw = serialize(GridCells(header=Header(frame_id="map"), cells=[Point(), Point()]))
    with pytest.raises(MessageError) as error:
        view(spoil(raw), GridCells)
    assert str(error.value) == text.replace("m\xffp", "m\\xffp").replace("m\x00p", "m\\x00p")


def test_more_values_than_a_sequence_may_have_are_refused():
    raw = bytearray(serialize(SolidPrimitive(type=1, dimensions=[1.0, 2.0, 3.0])))
    raw[8:12] = struct.pack("<I", 4)
    with pytest.raises(MessageError, match="dimensions: expected at most 3 values, got 4"):
        view(raw + bytes(8), SolidPrimitive)


def test_values_that_cannot_be_serialized_are_named():
    class Wide:
        @staticmethod
        def get_fields_and_field_types() -> dict[str, str]:
            return {"text": "wstring"}

    with pytest.raises(MessageError, match=r"Wide\.text: expected a type .*'wstring'"):
        view(bytes(12), Wide)
    with pytest.raises(MessageError, match="text: expected a text that UTF-8 can hold"):
        serialize(Marker(points=[Point()], text="\ud800"))
