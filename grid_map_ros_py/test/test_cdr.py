# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""Messages serialized from arrays are what rclpy serializes from message objects."""

import numpy as np
import pytest
from geometry_msgs.msg import Point
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import GridCells
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState, Range
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from grid_map_ros_py.cdr import serialize

TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=9)


def marker_with(points: np.ndarray, colors: np.ndarray, **fields: object) -> Marker:
    return Marker(
        points=[Point(x=x, y=y, z=z) for x, y, z in points.tolist()],
        colors=[ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in colors.tolist()],
        **fields,
    )


def assert_encodes(actual: bytes, message: object) -> None:
    """Assert that `actual` is `message` byte for byte, but for padding."""
    expected = serialize_message(message)
    # rclpy leaves padding undefined, and for empty sequences it adds a few bytes at the end.
    assert 0 <= len(expected) - len(actual) <= 8
    assert all(byte in (other, 0) for byte, other in zip(actual, expected, strict=False))
    # As text, so that NaN equals NaN.
    assert str(deserialize_message(actual, type(message))) == str(message)


@given(TEXTS, TEXTS, st.integers(0, 4))
def test_marker_is_the_same_wherever_alignment_puts_its_points(frame_id, namespace, count):
    random = np.random.default_rng(count)
    points, colors = random.random((count, 3)), random.random((count, 4), np.float32)
    marker = marker_with(points, colors, ns=namespace, text=frame_id)
    marker.header.frame_id = frame_id
    assert_encodes(serialize(marker, {"points": points, "colors": colors}), marker)


def test_every_other_field_keeps_its_value():
    marker = marker_with(np.ones((1, 3)), np.zeros((0, 4)), id=-7, frame_locked=True)
    marker.pose.orientation.y = 0.5
    marker.lifetime.nanosec = 4_000_000_000
    marker.texture.data = b"abc"
    marker.mesh_file.filename = "mesh"
    assert_encodes(serialize(marker, {"points": np.ones((1, 3))}), marker)


def test_cells_of_a_grid_are_points_too():
    message = GridCells(cell_width=0.5, cells=[Point(x=1.0, y=2.0), Point(z=-3.0)])
    cells = np.array([(1.0, 2.0, 0.0), (0.0, 0.0, -3.0)])
    assert_encodes(serialize(message, {"cells": cells}), message)


def test_numbers_and_texts_in_sequences_are_serialized_without_arrays():
    message = JointState(name=["first", "second"], position=[1.5], effort=[2.0, 3.0])
    assert_encodes(serialize(message, {}), message)
    assert_encodes(serialize(message, {"effort": np.array([2.0, 3.0])}), message)


def test_infinite_and_missing_numbers_are_kept_bit_by_bit():
    message = Range(radiation_type=1, min_range=float("nan"), max_range=float("-inf"))
    assert_encodes(serialize(message, {}), message)


def test_arrays_of_any_memory_order_are_serialized_row_by_row():
    points = np.asfortranarray(np.arange(6.0).reshape(2, 3)).astype(">f8")
    assert_encodes(serialize(Marker(), {"points": points}), marker_with(points, np.zeros((0, 4))))


def test_field_that_the_message_lacks_is_refused():
    with pytest.raises(AttributeError, match="pionts"):
        serialize(Marker(), {"pionts": np.zeros((1, 3))})
