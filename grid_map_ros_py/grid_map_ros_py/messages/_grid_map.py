# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`grid_map_msgs/GridMap` and `GridMap`."""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py.arrays import Layer, Size
from grid_map_core_py.map import select_layers, unwrapped

from ..errors import MessageError
from ._checks import check_position, check_positive, check_unrotated
from ._multi_array import from_multi_array, to_multi_array
from ._packages import messages_of
from ._time import from_stamp, to_header

if TYPE_CHECKING:
    from grid_map_msgs.msg import GridMap as GridMapMessage
    from grid_map_msgs.msg import GridMapInfo

LARGEST_START_INDEX = 2**16 - 1
"""The message has room for a uint16."""

LARGEST_SIDE = 2**31
"""Cells along a side; no map has more."""


def to_message(grid_map: GridMap, layers: Iterable[str] | None = None) -> "GridMapMessage":
    """Return a map as a message.

    Layers are sent in the order of the buffer together with the start index; a map whose start
    index does not fit the message is sent in map order with start index (0, 0).

    Args:
        grid_map: the map; its data is copied.
        layers: names of the layers to send, in this order; None means all. Basic layers that are
            not sent are left out of the message's `basic_layers` too.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        MessageError: the timestamp does not fit the message.
    """
    fields, first = outgoing(grid_map, layers, grid_map.start_index)
    if first != (0, 0):
        fields["data"] = [unwrapped(layer, first) for layer in fields["data"]]
    fields["data"] = [to_multi_array(layer) for layer in fields["data"]]
    header, info = to_header(grid_map), to_info(grid_map.geometry)
    return messages_of("grid_map_msgs").GridMap(header=header, info=info, **fields)


def outgoing(
    grid_map: GridMap, layers: Iterable[str] | None, start: Size
) -> tuple[dict[str, Any], Size]:
    """Return the fields of a map's message but `header` and `info`; `data` is the map's layers.

    Args:
        grid_map, layers: as for `to_message`, as are the errors.
        start: start index of the message; (0, 0) replaces one that does not fit the message.

    Returns:
        fields: attributes of the message.
        first: the cell of the arrays that the message stores first; the others follow cyclically.
    """
    names = select_layers(grid_map.layers, layers)
    if max(start) > LARGEST_START_INDEX:
        start = (0, 0)
    first, second = (
        (stored - sent) % cells
        for stored, sent, cells in zip(grid_map.start_index, start, grid_map.size, strict=True)
    )
    fields = {
        "layers": list(names),
        "basic_layers": [name for name in grid_map.basic_layers if name in names],
        "data": [grid_map[name] for name in names],
        "outer_start_index": start[0],
        "inner_start_index": start[1],
    }
    return fields, (first, second)


def from_message(
    message: "GridMapMessage",
    layers: Iterable[str] | None = None,
    *,
    copy_basic_layers: bool = True,
    unwrap: bool = True,
    copy: bool = True,
) -> GridMap:
    """Return the map in a message; it shares no memory with the message.

    The whole message is checked before anything is allocated. The z coordinate of the position is
    ignored; a map has none.

    Args:
        message: layers may be column-major or row-major.
        layers: names of the layers to take, in this order; None means all.
        copy_basic_layers: take over those basic layers that are among the layers taken.
        unwrap: bring the data into map order, with start index (0, 0). False keeps the order of the
            sender's buffer and its start index.
        copy: False makes read-only layers that share the memory of the message, where it holds them
            as a map does: column-major, and not to be unwrapped.

    Raises:
        MessageError: a field of the message contradicts another or is invalid; the error names
            the field, the expected and the actual value.
        LayerNotFoundError: `layers` names one that the message lacks.
    """
    geometry = from_info(message.info)
    views = _layer_views(message, geometry.size)
    start = received_start(message, geometry.size)
    for index, name in enumerate(message.basic_layers):
        if name not in message.layers:
            raise MessageError(f"basic_layers[{index}]", f"one of {list(message.layers)}", name)
    names = select_layers(views, layers)
    grid_map = GridMap.from_geometry(
        geometry, frame_id=message.header.frame_id, timestamp=from_stamp(message.header.stamp)
    )
    if not unwrap:
        grid_map.start_index, start = start, (0, 0)
    grid_map = grid_map.with_layers({name: _layer(views[name], start, copy=copy) for name in names})
    if copy_basic_layers:
        grid_map.basic_layers = [name for name in message.basic_layers if name in names]
    return grid_map


def to_info(geometry: GridGeometry) -> "GridMapInfo":
    """Return resolution, lengths and place of a grid as a message."""
    x, y = geometry.position.tolist()
    length_x, length_y = geometry.length.tolist()
    info: GridMapInfo = messages_of("grid_map_msgs").GridMapInfo(
        resolution=geometry.resolution, length_x=length_x, length_y=length_y
    )
    info.pose.position.x, info.pose.position.y = x, y
    return info


def from_info(info: "GridMapInfo") -> GridGeometry:
    """Return the grid that a message describes; lengths are rounded to whole cells.

    Raises:
        MessageError: a number is not finite or not positive, a side has no cells, or the grid is
            rotated.
    """
    resolution = check_positive("info.resolution", info.resolution)
    for name in ("length_x", "length_y"):
        length = check_positive(f"info.{name}", getattr(info, name))
        cells = length / resolution
        if not (cells + 0.5 >= 1 and cells <= LARGEST_SIDE):
            expected = f"1 to {LARGEST_SIDE} cells of {resolution} m"
            raise MessageError(f"info.{name}", expected, length)
    position = check_position("info.pose.position", info.pose.position)
    check_unrotated("info.pose.orientation", info.pose.orientation)
    return GridGeometry(np.array([info.length_x, info.length_y]), resolution, np.array(position))


def _layer_views(message: "GridMapMessage", size: Size) -> Mapping[str, Layer]:
    """Return the layers in the message's memory, after checking their names, sizes and data."""
    names = list(message.layers)
    if "" in names:
        raise MessageError(f"layers[{names.index('')}]", "a name", "")
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise MessageError("layers", "every name once", repeated)
    if len(message.data) != len(names):
        expected = f"{len(names)} arrays, one for each of layers {names}"
        raise MessageError("data", expected, len(message.data))
    return {
        name: from_multi_array(values, size, f"layer {name!r}, data[{index}]")
        for index, (name, values) in enumerate(zip(names, message.data, strict=True))
    }


def received_start(message: "GridMapMessage", size: Size) -> Size:
    """Return the start index of a message, which must be a cell of the map."""
    start = (message.outer_start_index, message.inner_start_index)
    for name, index, cells in zip(("outer", "inner"), start, size, strict=True):
        if not 0 <= index < cells:
            raise MessageError(f"{name}_start_index", f"0 to {cells - 1}", index)
    return start


def _layer(view: Layer, start: Size, *, copy: bool) -> Layer:
    flags = view.flags
    if copy or start != (0, 0) or not (flags.f_contiguous and flags.aligned):
        return unwrapped(view, start)
    shared = view.view()
    shared.flags.writeable = False
    return shared
