# SPDX-License-Identifier: BSD-3-Clause
import copy
from functools import partial
from typing import Any

import numpy as np
import pytest
from cpp_golden import assert_header, assert_pose, cases, to_map
from geometry_msgs.msg import Quaternion
from hypothesis import given, settings
from rclpy.serialization import serialize_message
from wire import assert_identical, over_the_wire, row_major, set_field

from grid_map_core_py import GridMap, LayerNotFoundError
from grid_map_core_py.testing import assert_maps_equal, grid_maps, moved_in_buffer
from grid_map_ros_py import (
    from_message,
    from_serialized_message,
    to_image,
    to_message,
    to_occupancy_grid,
    to_point_cloud,
    to_serialized_message,
)

maps = grid_maps(layers=("elevation", "color", "élévation ∞"))


def sample_map(size: tuple[int, int] = (3, 4), start: tuple[int, int] = (2, 1)) -> GridMap:
    values = np.arange(size[0] * size[1], dtype=np.float32).reshape(size)
    grid_map = GridMap(
        np.multiply(size, 0.5),
        0.5,
        (1.0, -2.0),
        {"elevation": values, "variance": -values},
        basic_layers=["elevation"],
        frame_id="odom",
        timestamp=12_000_000_034,
    )
    return moved_in_buffer(grid_map, start)


@settings(max_examples=60)
@given(maps)
def test_buffer_survives_the_wire_bit_by_bit(grid_map: GridMap) -> None:
    message = over_the_wire(to_message(grid_map))
    assert_maps_equal(from_message(message), grid_map)
    assert from_message(message).start_index == (0, 0)
    assert_identical(from_message(message, unwrap=False), grid_map)


@pytest.mark.parametrize(
    "convert",
    [
        to_message,
        partial(to_point_cloud, point_layer="elevation"),
        partial(to_occupancy_grid, layer="elevation", data_min=0.0, data_max=1.0),
        partial(to_image, layer="elevation", encoding="mono8"),
    ],
)
def test_message_says_that_the_reference_system_is_lost(convert: Any) -> None:
    grid_map = sample_map()
    grid_map.crs = "EPSG:25832"
    with pytest.warns(UserWarning, match="crs: a message cannot hold .* it is lost") as caught:
        convert(grid_map)
    assert [warning.filename for warning in caught] == [__file__]


def test_map_and_message_share_no_memory() -> None:
    grid_map = sample_map(start=(0, 0))
    message = to_message(grid_map)
    before = copy.deepcopy(message)
    received = from_message(message)
    received["elevation"][...] = grid_map["elevation"][...] = -1.0
    assert message == before
    assert received["elevation"].flags.f_contiguous


@pytest.mark.parametrize("serialized", [True, False])
@pytest.mark.parametrize(
    "options", [{}, {"unwrap": False}, {"copy": False}, {"unwrap": False, "copy": False}]
)
def test_row_major_layers_are_read_like_column_major_ones(options: Any, serialized: bool) -> None:
    grid_map = sample_map()
    message = to_message(grid_map)
    message.data = [row_major(grid_map[name], data_offset=3) for name in grid_map]
    if serialized:
        received = from_serialized_message(serialize_message(message), **options)
    else:
        received = from_message(over_the_wire(message), **options)
    assert_maps_equal(received, grid_map)
    assert received["elevation"].flags.f_contiguous


def test_layers_are_sent_and_read_in_requested_order() -> None:
    message = to_message(sample_map(), ["variance", "elevation"])
    assert message.layers == ["variance", "elevation"]
    assert message.data[1].data.tolist() == sample_map()["elevation"].ravel("F").tolist()
    for read, sent in (
        (from_message, to_message),
        (from_serialized_message, to_serialized_message),
    ):
        for wanted in ("variance", ["variance"]):
            # C++ also lists basic layers that it did not send, and readers fail on them.
            for received in (read(sent(sample_map(), wanted)), read(sent(sample_map()), wanted)):
                assert (received.layers, received.basic_layers) == (("variance",), ())
        with pytest.raises(LayerNotFoundError, match=r"'slope'; available: elevation, variance"):
            sent(sample_map(), ["slope"])
        with pytest.raises(LayerNotFoundError, match=r"'slope'; available: elevation, variance"):
            read(sent(sample_map()), ["elevation", "slope"])


def test_start_index_beyond_uint16_is_sent_unwrapped() -> None:
    values = np.arange(66_000, dtype=np.float32)[:, None]
    grid_map = GridMap((6600.0, 0.1), 0.1, layers={"elevation": values})
    moved = moved_in_buffer(grid_map, (65_990, 0))
    message = to_message(moved)
    assert (message.outer_start_index, message.inner_start_index) == (0, 0)
    serialized = from_serialized_message(to_serialized_message(moved), unwrap=False)
    assert serialized.start_index == (0, 0)
    for received in (from_message(message), serialized):
        np.testing.assert_array_equal(received["elevation"], values)
    assert moved.start_index == (65_990, 0)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        *(
            (f"data[0].layout.dim[{axis}].stride", stride)
            for axis, strides in enumerate([(0, 3, 12), (0, 1, 3, 12)])
            for stride in strides
        ),
        *(("info.pose.orientation", Quaternion(z=1e-9 * w, w=w)) for w in (0.0, 1.0, -1.0, 0.5)),
        ("info.length_x", 1.6),
    ],
)
def test_differences_between_publishers_are_accepted(path: str, value: object) -> None:
    message = to_message(sample_map())
    set_field(message, path, value)
    assert_maps_equal(from_message(message), sample_map())


@pytest.mark.parametrize(
    ("grid_map", "case"), cases("to_message") + cases("to_message_layers_full")
)
def test_messages_equal_cpp(grid_map: GridMap, case: dict[str, Any]) -> None:
    expected = case.get("message", case)
    grid_map.basic_layers = [n for n in expected["basic_layers"] if n in grid_map]
    message = over_the_wire(to_message(grid_map, expected["layers"]))
    assert_header(message.header, expected["header"])
    assert_pose(message.info.pose, expected["pose"])
    for name in ("resolution", "length_x", "length_y"):
        assert getattr(message.info, name) == expected[name]
    for name in ("layers", "outer_start_index", "inner_start_index"):
        assert getattr(message, name) == expected[name]
    assert message.basic_layers == [n for n in expected["basic_layers"] if n in expected["layers"]]
    for layer, data in zip(message.data, expected["data"], strict=True):
        assert [
            {"label": d.label, "size": d.size, "stride": d.stride} for d in layer.layout.dim
        ] == (data["dim"])
        assert layer.layout.data_offset == data["data_offset"]
        np.testing.assert_array_equal(layer.data, np.array(data["data"], dtype=np.float32))


@pytest.mark.parametrize(("grid_map", "case"), cases("from_message"))
def test_maps_equal_cpp(grid_map: GridMap, case: dict[str, Any]) -> None:
    grid_map.basic_layers = case["result"]["basic_layers"]
    expected = to_map(case["result"])
    received = from_message(to_message(grid_map), unwrap=False)
    assert_maps_equal(received, expected)
    assert received.start_index == expected.start_index
    assert received.position.tolist() == expected.position.tolist()


def test_one_layer_without_basic_layers_is_read_as_by_cpp() -> None:
    for grid_map, case in cases("from_message_only_full_no_basic"):
        grid_map.basic_layers = ["elevation"]
        received = from_message(to_message(grid_map), ["full"], copy_basic_layers=False)
        assert_maps_equal(received, to_map(case["result"]))
        assert received.basic_layers == ()
