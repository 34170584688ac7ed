# SPDX-License-Identifier: BSD-3-Clause
import array
import tracemalloc

import numpy as np
import pytest
from std_msgs.msg import Float32MultiArray, MultiArrayDimension, MultiArrayLayout

from grid_map_ros_py import MessageError
from grid_map_ros_py.messages import from_multi_array, to_multi_array

LAYER = np.arange(6, dtype=np.float32).reshape(2, 3)


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


def test_values_are_sent_column_after_column() -> None:
    message = to_multi_array(LAYER)
    assert message.data.tolist() == [0, 3, 1, 4, 2, 5]
    assert [(d.label, d.size, d.stride) for d in message.layout.dim] == [
        ("column_index", 3, 6),
        ("row_index", 2, 2),
    ]


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (4, 1), (3, 5)])
def test_arrays_of_any_order_round_trip(shape: tuple[int, int], order: str) -> None:
    values = np.random.default_rng(1).random(shape, np.float32).copy(order)  # type: ignore[call-overload]
    np.testing.assert_array_equal(from_multi_array(to_multi_array(values), shape), values)


@pytest.mark.parametrize("data_offset", [0, 5])
def test_row_major_values_are_understood(data_offset: int) -> None:
    message = row_major(LAYER, data_offset=data_offset)
    np.testing.assert_array_equal(from_multi_array(message, (2, 3)), LAYER)


@pytest.mark.parametrize("strides", [(0, 0), (2, 1), (2, 6), (6, 2)])
def test_unset_and_other_valid_strides_are_accepted(strides: tuple[int, int]) -> None:
    message = to_multi_array(LAYER)
    for dim, stride in zip(message.layout.dim, strides, strict=True):
        dim.stride = stride
    np.testing.assert_array_equal(from_multi_array(message, (2, 3)), LAYER)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("stride", [7, 12, 2**32 - 1])
def test_strides_of_padded_values_are_refused(axis: int, stride: int) -> None:
    message = to_multi_array(LAYER)
    message.layout.dim[axis].stride = stride
    text = rf"dim\[{axis}\]\.stride: expected one of .*as there is no padding.*, got {stride}"
    with pytest.raises(MessageError, match=text):
        from_multi_array(message, (2, 3))


def test_reading_copies_nothing() -> None:
    message = to_multi_array(LAYER)
    message_memory = np.frombuffer(message.data, np.float32)
    assert np.shares_memory(from_multi_array(message, (2, 3)), message_memory)


def test_writing_copies_once() -> None:
    layer = np.ones((500, 500), np.float32, order="F")
    tracemalloc.start()
    message = to_multi_array(layer)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(message.data) == layer.size
    assert peak < 1.2 * layer.nbytes
