# SPDX-License-Identifier: BSD-3-Clause
"""`std_msgs/Float32MultiArray` and (rows, cols) arrays: one layer of a `GridMap` message."""

import array
from collections.abc import Iterator
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py._arrays import Layer, Size

from ..errors import MessageError
from ._packages import messages_of

if TYPE_CHECKING:
    from std_msgs.msg import Float32MultiArray

LABELS = ("column_index", "row_index")
"""Labels of the dimensions of column-major data; those of row-major data are in reverse."""


def to_multi_array(layer: npt.ArrayLike) -> "Float32MultiArray":
    """Return a (rows, cols) array as a column-major message.

    Float32 in Fortran order, as maps hold it, is copied once.
    """
    messages = messages_of("std_msgs")
    data = np.asarray(layer, dtype=np.float32, order="F")
    message = messages.Float32MultiArray()
    dimension = messages.MultiArrayDimension
    message.layout.dim = [
        dimension(label=label, size=count, stride=stride)
        for label, count, stride in _dimensions(data.shape)
    ]
    values = array.array("f")
    values.frombytes(data.T.data.cast("B"))
    set_array(message, values)
    return message


def set_array(message: Any, values: "array.array[Any]") -> None:
    """Let a message keep an array as its `data`, without a copy.

    The constructor and the setter that rosidl generates copy it, unless they check every field. An
    array of another type than the field's must not come here.
    """
    message._data = values


def to_layout(size: Size) -> Any:
    """Return an object with the attributes of `MultiArrayLayout`, for a column-major layer."""
    dim = [
        SimpleNamespace(label=label, size=count, stride=stride)
        for label, count, stride in _dimensions(size)
    ]
    return SimpleNamespace(dim=dim, data_offset=0)


def _dimensions(size: Size) -> Iterator[tuple[str, int, int]]:
    """Return label, size and stride of both dimensions of a column-major layer."""
    rows, columns = size
    return zip(LABELS, (columns, rows), (rows * columns, rows), strict=True)


def from_multi_array(
    message: "Float32MultiArray", size: Size, field: str = "Float32MultiArray"
) -> Layer:
    """Return the (rows, cols) values of a message: a view of its memory, nothing is copied.

    Column-major (`column_index` first) and row-major data (`row_index` first) are understood. Data
    begins after `data_offset` values and must end with the array. Publishers leave strides unset or
    count them in their own ways, so that all that occur without padding are understood.

    Args:
        message: the layer.
        size: rows and columns that it must have.
        field: name of the message in errors.

    Raises:
        MessageError: labels, sizes, strides or the number of values are not those of such an array.
    """
    labels = tuple(dim.label for dim in message.layout.dim)
    if labels not in (LABELS, LABELS[::-1]):
        expected = f"the labels {LABELS}, or in reverse"
        raise MessageError(f"{field}.layout.dim", expected, labels)
    shape = size[::-1] if labels == LABELS else size
    offset, cells = message.layout.data_offset, size[0] * size[1]
    for axis, (dim, count) in enumerate(zip(message.layout.dim, shape, strict=True)):
        if dim.size != count:
            expected = f"{count} ({dim.label} of {size[0]} x {size[1]} cells)"
            raise MessageError(f"{field}.layout.dim[{axis}].size", expected, dim.size)
    if len(message.data) != offset + cells:
        expected = f"{offset + cells} values ({size[0]} x {size[1]} cells"
        expected += f" after data_offset {offset})" if offset else ")"
        raise MessageError(f"{field}.data", expected, len(message.data))
    strides = (0, 1, *shape, cells)
    for axis, dim in enumerate(message.layout.dim):
        if dim.stride not in strides:
            expected = f"one of {strides}, as there is no padding"
            raise MessageError(f"{field}.layout.dim[{axis}].stride", expected, dim.stride)
    values: Layer = np.asarray(message.data)[offset:].reshape(shape)
    return values.T if labels == LABELS else values
