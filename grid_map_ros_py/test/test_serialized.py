# SPDX-License-Identifier: BSD-3-Clause
"""Maps as bytes: equal to rclpy, and read with the checks of messages."""

import struct
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from rclpy.serialization import serialize_message
from test_cdr import assert_encodes
from test_grid_map import maps, sample_map
from wire import assert_identical

from conftest import peak_memory
from grid_map_core_py import GridMap, OutOfMapError
from grid_map_core_py.limits import changed_limits
from grid_map_core_py.testing import assert_maps_equal, moved_in_buffer
from grid_map_msgs.msg import GridMap as GridMapMessage
from grid_map_ros_py import (
    MessageError,
    ReceivedMap,
    from_message,
    from_serialized_message,
    to_message,
    to_serialized_message,
)


@settings(max_examples=60)
@given(maps, st.none() | st.sets(st.sampled_from(["elevation", "color"])))
def test_bytes_equal_rclpy(grid_map: GridMap, layers: set[str] | None) -> None:
    assert_encodes(to_serialized_message(grid_map, layers), to_message(grid_map, layers))


@settings(max_examples=60)
@given(maps, st.none() | st.sets(st.sampled_from(["elevation", "color"])), *[st.booleans()] * 2)
def test_bytes_of_rclpy_are_read_like_its_message(
    grid_map: GridMap, layers: set[str] | None, copy_basic_layers: bool, unwrap: bool
) -> None:
    message = to_message(grid_map)
    options: Any = {"layers": layers, "copy_basic_layers": copy_basic_layers, "unwrap": unwrap}
    received = from_serialized_message(serialize_message(message), **options)
    expected = from_message(message, **options)
    assert_identical(received, expected)


@settings(max_examples=60)
@given(maps, st.data())
def test_map_is_sent_from_any_start_index(grid_map: GridMap, data: st.DataObject) -> None:
    rows, columns = grid_map.size
    start = data.draw(st.tuples(st.integers(0, rows - 1), st.integers(0, columns - 1)))
    serialized = to_serialized_message(grid_map, start_index=start)
    assert serialized == to_serialized_message(moved_in_buffer(grid_map, start))


def test_start_index_beyond_the_map_is_refused() -> None:
    rows, _ = sample_map().size
    with pytest.raises(OutOfMapError, match="outside the map"):
        to_serialized_message(sample_map(), start_index=(rows, 0))


@settings(max_examples=30)
@given(maps)
def test_map_without_a_copy_shares_the_message(grid_map: GridMap) -> None:
    data = to_serialized_message(grid_map)
    received = from_serialized_message(data, unwrap=False, copy=False)
    assert_identical(received, grid_map)
    memory = np.frombuffer(data, np.uint8)
    for name in received:
        assert not received[name].flags.writeable
        assert np.shares_memory(received[name], memory)
    assert_maps_equal(from_serialized_message(data, copy=False), grid_map)


def test_only_requested_layers_need_memory() -> None:
    names = [f"layer {k}" for k in range(20)]
    grid_map = GridMap((20.0, 20.0), 0.1, layers=dict.fromkeys(names, 1.0))
    data = to_serialized_message(grid_map)
    layer_size = grid_map[names[0]].nbytes
    assert peak_memory(lambda: from_serialized_message(data, names[:2])) < 2.5 * layer_size
    assert peak_memory(lambda: to_serialized_message(grid_map, names[:2])) < 2.5 * layer_size


def test_received_map_has_its_facts_without_decoding() -> None:
    data = to_serialized_message(GridMap((30.0, 20.0), 0.1, layers=["a", "b"], frame_id="odom"))

    def look() -> ReceivedMap:
        received = ReceivedMap(data)
        assert received.layers == ("a", "b")
        assert (received.frame_id, received.geometry.size) == ("odom", (300, 200))
        return received

    assert peak_memory(look) < 50_000
    assert look().data is data


def test_received_map_can_be_decoded_repeatedly() -> None:
    with pytest.raises(MessageError, match="encoding"):
        ReceivedMap(b"noise").frame_id  # noqa: B018
    received = ReceivedMap(to_serialized_message(sample_map()))
    assert received.basic_layers == ("elevation",)
    assert received.timestamp == sample_map().timestamp
    assert_maps_equal(received.decode(), sample_map())
    assert received.decode("variance").layers == ("variance",)
    assert received.decode(unwrap=False, copy_basic_layers=False).basic_layers == ()
    assert received.decode(unwrap=False).start_index == sample_map().start_index


# --- bad messages ---------------------------------------------------------------------------------


def test_declared_lengths_are_checked_before_allocation() -> None:
    data = to_serialized_message(GridMap((1.0, 1.0), 0.5, layers=["elevation"]))
    for place in range(4, len(data) - 4, 4):
        spoilt = data[:place] + struct.pack("<I", 0x7FFFFFF0) + data[place + 4 :]

        def read(spoilt: bytes = spoilt) -> None:
            with suppress(MessageError):
                from_serialized_message(spoilt)

        assert peak_memory(read) < 100_000


def test_huge_grid_without_layers_needs_no_memory() -> None:
    message = GridMapMessage()
    message.info.resolution = 1.0
    message.info.length_x = message.info.length_y = 2.0e9
    message.info.pose.orientation.w = 1.0
    data = serialize_message(message)
    with changed_limits(max_cells=1e19):
        assert from_message(message).size == (2 * 10**9, 2 * 10**9)
        assert peak_memory(lambda: from_serialized_message(data)) < 100_000
        message.info.length_x = 4.0e9
        with pytest.raises(MessageError, match=r"info\.length_x: expected 1 to 2147483648 cells"):
            from_serialized_message(serialize_message(message))
