# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between `GridMap` and `grid_map_msgs/GridMap`, as a message or serialized (CDR)."""

import array
from collections.abc import Iterable, Mapping
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py._arrays import Layer, Size
from grid_map_core_py._arrays._checks import is_name, select_layers
from grid_map_core_py.files._shared import say_crs_is_lost
from grid_map_core_py.limits import check_cells
from grid_map_core_py.map._ring_buffer import unwrapped

from ..errors import MessageError
from ._cdr import Buffer, Reordered, serialize, view
from ._definition import GRID_MAP
from ._fields import (
    NANOSECONDS,
    check_fields,
    check_nanoseconds,
    check_position,
    check_positive,
    check_unique,
    check_unrotated,
    from_stamp,
)
from ._packages import messages_of, set_array

if TYPE_CHECKING:
    from std_msgs.msg import Float32MultiArray

    from grid_map_msgs.msg import GridMap as GridMapMessage, GridMapInfo

LARGEST_START_INDEX = 2**16 - 1
"""Largest start index that a message can hold (uint16)."""

_LABELS = ("column_index", "row_index")
"""Dimension labels of column-major layers; row-major layers have them in reverse order."""

LARGEST_SIDE = 2**31
"""Maximum number of cells along a side."""


# --- writing --------------------------------------------------------------------------------------


def to_message(grid_map: GridMap, layers: Iterable[str] | None = None) -> "GridMapMessage":
    """Convert a map to a `grid_map_msgs/GridMap` message.

    The layers are in buffer order, with the start index of the map. If the start index exceeds
    65535, the layers are in map order, with the start index (0, 0).

    Args:
        grid_map: the map; its data is copied.
        layers: names of the layers to send, in this order; None means all. `basic_layers` of the
            message contains only basic layers that are sent.
    """
    plain = _described(grid_map, layers, grid_map.start_index)
    messages, arrays = messages_of("std_msgs"), []
    for described in plain.data:
        values = array.array("f")
        if isinstance(described.data, Reordered):
            values.frombytes(described.data.values.data.cast("B"))
            described.data.write(np.frombuffer(values, np.float32))
        else:
            values.frombytes(described.data.data.cast("B"))
        multi_array = messages.Float32MultiArray()
        dimensions = described.layout.dim
        multi_array.layout.dim = [messages.MultiArrayDimension(**vars(one)) for one in dimensions]
        set_array(multi_array, values)
        arrays.append(multi_array)
    plain.data = arrays
    return _filled(messages_of("grid_map_msgs").GridMap(), plain)


def to_serialized_message(
    grid_map: GridMap, layers: Iterable[str] | None = None, *, start_index: Size | None = None
) -> bytes:
    """Convert a map to a serialized message (CDR), which publishers accept in place of a message.

    Args:
        grid_map, layers: as for `to_message`.
        start_index: start index (row, column) of the message; None keeps the start index of the
            map.
    """
    if start_index is None:
        start_index = grid_map.start_index
    grid_map.geometry.check_indices(np.asarray(start_index))
    plain = _described(grid_map, layers, start_index)
    return serialize(plain, message_type=GRID_MAP)


def to_info(geometry: GridGeometry) -> "GridMapInfo":
    return _filled(messages_of("grid_map_msgs").GridMapInfo(), _info(geometry))


def _described(grid_map: GridMap, layers: Iterable[str] | None, start: Size) -> SimpleNamespace:
    """Return an object with the attributes of a map message with the start index `start`."""
    names = select_layers(grid_map.layers, layers)
    say_crs_is_lost(grid_map, "a message", stacklevel=4)
    if max(start) > LARGEST_START_INDEX:
        start = (0, 0)
    # Cell of the map buffer that becomes the first cell in the message.
    row, column = (
        (stored - sent) % cells
        for stored, sent, cells in zip(grid_map.start_index, start, grid_map.size, strict=True)
    )
    first = (row, column)
    seconds, rest = divmod(check_nanoseconds(grid_map.timestamp), NANOSECONDS)
    stamp = SimpleNamespace(sec=seconds, nanosec=rest)
    rows, columns = grid_map.size
    outer, inner = _LABELS
    dimensions = [
        SimpleNamespace(label=outer, size=columns, stride=rows * columns),
        SimpleNamespace(label=inner, size=rows, stride=rows),
    ]
    layout = SimpleNamespace(dim=dimensions, data_offset=0)

    def ordered(layer: Layer) -> Layer | Reordered:
        values = np.asarray(layer, np.float32, order="F").ravel("K")
        if first == (0, 0):
            return values
        return Reordered(
            values, lambda sent: unwrapped(layer, first, out=sent.reshape(layer.shape, order="F"))
        )

    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp, frame_id=grid_map.frame_id),
        info=_info(grid_map.geometry),
        layers=list(names),
        basic_layers=[*filter({*names}.__contains__, grid_map.basic_layers)],
        data=[SimpleNamespace(layout=layout, data=ordered(grid_map[name])) for name in names],
        outer_start_index=start[0],
        inner_start_index=start[1],
    )


def _info(geometry: GridGeometry) -> SimpleNamespace:
    x, y = geometry.position.tolist()
    length_x, length_y = geometry.length.tolist()
    position = SimpleNamespace(x=x, y=y, z=0.0)
    orientation = SimpleNamespace(x=0.0, y=0.0, z=0.0, w=1.0)
    pose = SimpleNamespace(position=position, orientation=orientation)
    return SimpleNamespace(
        resolution=geometry.resolution, length_x=length_x, length_y=length_y, pose=pose
    )


def _filled(message: Any, plain: SimpleNamespace) -> Any:
    for name, value in vars(plain).items():
        if isinstance(value, SimpleNamespace):
            _filled(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


# --- reading --------------------------------------------------------------------------------------


def from_message(
    message: "GridMapMessage",
    layers: Iterable[str] | None = None,
    *,
    copy_basic_layers: bool = True,
    unwrap: bool = True,
    copy: bool = True,
) -> GridMap:
    """Create a map from a `grid_map_msgs/GridMap` message.

    Args:
        message: the message, with column-major or row-major layers; z of its position is ignored.
        layers: names of the layers to decode, in this order; None means all.
        copy_basic_layers: keep the basic layers that are among the decoded layers.
        unwrap: if True, the map is in map order, with start index (0, 0). If False, the map keeps
            the buffer order and the start index of the message.
        copy: if False, layers share the memory of the message where possible. Shared layers are
            read-only. Row-major layers and layers that must be unwrapped are always copied.
    """
    check_fields(message, "grid_map_msgs/GridMap", "info", "basic_layers")
    geometry = from_info(message.info)
    views = _layer_views(message, geometry.size)
    start = _start_index(message, geometry.size)
    for index, name in enumerate(message.basic_layers):
        if name not in views:
            raise MessageError(f"basic_layers[{index}]", f"one of {list(message.layers)}", name)
    names = select_layers(views, layers)
    grid_map = GridMap.from_geometry(
        geometry, frame_id=message.header.frame_id, timestamp=from_stamp(message.header.stamp)
    )
    if not unwrap:
        grid_map.start_index, start = start, (0, 0)
    grid_map = grid_map.with_layers({name: _layer(views[name], start, copy=copy) for name in names})
    if copy_basic_layers:
        grid_map.basic_layers = [name for name in message.basic_layers if name in grid_map]
    return grid_map


def from_serialized_message(
    data: Buffer,
    layers: Iterable[str] | None = None,
    *,
    copy_basic_layers: bool = True,
    unwrap: bool = True,
    copy: bool = True,
) -> GridMap:
    """Create a map from a message in CDR, for example from a raw subscription or a bag.

    See `from_message` for the other arguments and the errors.
    """
    message = view(data, GRID_MAP)
    return from_message(
        message, layers, copy_basic_layers=copy_basic_layers, unwrap=unwrap, copy=copy
    )


class ReceivedMap:
    """A serialized map message that decodes only the requested layers.

    If the data is not a valid message, all attributes except `data` raise `MessageError`.

    Args:
        data: the message in CDR. Publishers accept the attribute `data` in place of a message.
    """

    def __init__(self, data: Buffer) -> None:
        self.data = data

    @property
    def frame_id(self) -> str:
        """Coordinate frame of the map."""
        frame_id: str = self._message.header.frame_id
        return frame_id

    @property
    def timestamp(self) -> int:
        """Time of the data [ns]."""
        return from_stamp(self._message.header.stamp)

    @property
    def geometry(self) -> GridGeometry:
        """Size, resolution and position of the grid."""
        return from_info(self._message.info)

    @property
    def start_index(self) -> Size:
        """Start index (row, col) of the circular buffer."""
        return _start_index(self._message, self.geometry.size)

    @property
    def layers(self) -> tuple[str, ...]:
        """Names of the layers."""
        return tuple(self._message.layers)

    @property
    def basic_layers(self) -> tuple[str, ...]:
        """Names of the layers that must be finite for a cell to be valid."""
        return tuple(self._message.basic_layers)

    def decode(
        self,
        layers: Iterable[str] | None = None,
        *,
        copy_basic_layers: bool = True,
        unwrap: bool = True,
        copy: bool = True,
    ) -> GridMap:
        """Decode all layers or the given layers; see `from_message` for the arguments."""
        return from_message(
            self._message, layers, copy_basic_layers=copy_basic_layers, unwrap=unwrap, copy=copy
        )

    @cached_property
    def _message(self) -> Any:
        return view(self.data, GRID_MAP)


def from_info(info: "GridMapInfo") -> GridGeometry:
    """Convert `grid_map_msgs/GridMapInfo` to a geometry; lengths are rounded to whole cells."""
    resolution = check_positive("info.resolution", info.resolution)
    for name in ("length_x", "length_y"):
        length = check_positive(f"info.{name}", getattr(info, name))
        cells = length / resolution
        if not (cells + 0.5 >= 1 and cells <= LARGEST_SIDE):
            expected = f"1 to {LARGEST_SIDE} cells of {resolution} m"
            raise MessageError(f"info.{name}", expected, length)
    position = check_position("info.pose.position", info.pose.position)
    check_unrotated("info.pose.orientation", info.pose.orientation)
    sides = np.array([info.length_x, info.length_y])
    geometry = GridGeometry(sides, resolution, np.array(position))
    check_cells("info", geometry.size)
    return geometry


def _layer_views(message: "GridMapMessage", size: Size) -> Mapping[str, Layer]:
    """Return views of the layers by name; raise `MessageError` if the message is invalid."""
    names = list(message.layers)
    if len(message.data) != len(names):
        expected = f"{len(names)} arrays, one for each of layers {names}"
        raise MessageError("data", expected, len(message.data))
    for index, name in enumerate(names):
        if not is_name(name):
            expected = "a name without control characters"
            raise MessageError(f"layers[{index}]", expected, name)
    check_unique("layers", names)
    return {
        name: _from_multi_array(values, size, f"layer {name!r}, data[{index}]")
        for index, (name, values) in enumerate(zip(names, message.data, strict=True))
    }


def _from_multi_array(message: "Float32MultiArray", size: Size, field: str) -> Layer:
    """Return the values (rows, cols) of a `Float32MultiArray` as a view of the message data."""
    labels = tuple(dim.label for dim in message.layout.dim)
    if labels not in (_LABELS, _LABELS[::-1]):
        expected = f"the labels {_LABELS}, or in reverse"
        raise MessageError(f"{field}.layout.dim", expected, labels)
    shape = size[::-1] if labels == _LABELS else size
    offset, cells = message.layout.data_offset, size[0] * size[1]
    for axis, (dim, count) in enumerate(zip(message.layout.dim, shape, strict=True)):
        if dim.size != count:
            expected = f"{count} ({dim.label} of {size[0]} x {size[1]} cells)"
            raise MessageError(f"{field}.layout.dim[{axis}].size", expected, dim.size)
    if len(message.data) != offset + cells:
        expected = f"{offset + cells} values ({size[0]} x {size[1]} cells"
        expected += f" after data_offset {offset})" if offset else ")"
        raise MessageError(f"{field}.data", expected, len(message.data))
    # Publishers use different conventions for strides, or leave them unset.
    strides = (0, 1, *shape, cells)
    for axis, dim in enumerate(message.layout.dim):
        if dim.stride not in strides:
            expected = f"one of {strides}, as there is no padding"
            raise MessageError(f"{field}.layout.dim[{axis}].stride", expected, dim.stride)
    values: Layer = np.asarray(message.data)[offset:].reshape(shape)
    return values.T if labels == _LABELS else values


def _start_index(message: "GridMapMessage", size: Size) -> Size:
    start = (message.outer_start_index, message.inner_start_index)
    for name, index, cells in zip(("outer", "inner"), start, size, strict=True):
        if not 0 <= index < cells:
            raise MessageError(f"{name}_start_index", f"0 to {cells - 1}", index)
    return start


def _layer(view: Layer, start: Size, *, copy: bool) -> Layer:
    if start != (0, 0):
        return unwrapped(view, start)
    if copy or not (view.flags.f_contiguous and view.flags.aligned):
        return view.copy("F")
    shared = view.view()
    shared.flags.writeable = False
    return shared
