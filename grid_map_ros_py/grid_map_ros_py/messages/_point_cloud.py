# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`sensor_msgs/PointCloud2` and grid maps."""

import array
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from grid_map_core_py import GridMap
from grid_map_core_py.arrays import Mask, slices
from grid_map_core_py.map import select_layers

from ..errors import MessageError
from ._multi_array import set_array
from ._packages import messages_of
from ._time import to_header

if TYPE_CHECKING:
    from sensor_msgs.msg import PointCloud2

AXES = ("x", "y", "z")
FLAT_LAYER = "flat"
FLOAT = np.dtype("<f4")
BLOCK = 8192


def to_point_cloud(
    grid_map: GridMap, point_layer: str, layers: Iterable[str] | None = None
) -> "PointCloud2":
    """Return one point for every valid cell of a map.

    A cell is valid where the point layer is finite and, when the map has basic layers, these are
    finite too. The points come column after column of the map's buffer. All fields are float32 in
    the order of the layers: x, y, z [m] in place of the point layer, `color` under the name `rgb`
    that viewers know (unless a layer has that name), all others under their own names.

    Args:
        grid_map: the map.
        point_layer: the layer that gives z.
        layers: names of the layers to send; None means all. x, y, z come first if the point layer
            is not among them.

    Raises:
        LayerNotFoundError: the map lacks a layer.
        MessageError: another layer is called x, y or z.
    """
    select_layers(grid_map.layers, point_layer)
    names = select_layers(grid_map.layers, layers)
    if point_layer not in names:
        names = (point_layer, *names)
    fields: list[str] = []
    for name in names:
        if name == point_layer:
            fields += AXES
        else:
            fields.append("rgb" if name == "color" and "rgb" not in names else name)
    for axis in AXES:
        if fields.count(axis) > 1:
            raise MessageError("fields", f"no layer called {axis!r} beside the coordinates", fields)
    valid = grid_map.valid_mask((point_layer, *grid_map.basic_layers))
    return _message(grid_map, fields, _interleaved(grid_map, names, point_layer, valid))


def to_flat_point_cloud(grid_map: GridMap, height: float = 0.0) -> "PointCloud2":
    """Return the cells of a map as points of one height.

    All layers are carried along, and x, y, z come last. Cells where a basic layer is not finite are
    left out; without basic layers there is a point for every cell.

    Args:
        grid_map: the map.
        height: z of the points [m].

    Raises:
        MessageError: the height is not finite, or a layer is called x, y or z.
    """
    if not abs(height) <= np.finfo(np.float32).max:
        raise MessageError("height", "a finite number", height)
    flat = np.full(grid_map.size, height, dtype=np.float32, order="F")
    # Replaces a layer of the same name, as if the new one had been added last.
    others = [name for name in grid_map.layers if name != FLAT_LAYER]
    return to_point_cloud(
        grid_map.with_layers({FLAT_LAYER: flat}), FLAT_LAYER, [*others, FLAT_LAYER]
    )


def _interleaved(
    grid_map: GridMap, names: tuple[str, ...], point_layer: str, valid: Mask
) -> "array.array[int]":
    """Return the bytes of (N, fields) little-endian float32: one row per valid cell."""
    rows, columns = grid_map.size
    with np.errstate(over="ignore"):
        x, y = (axis.astype(FLOAT) for axis in grid_map.axes())
    layers = [grid_map[name].ravel("F") for name in names]
    field_of_x = names.index(point_layer)
    fields = [*range(field_of_x), *range(field_of_x + 2, len(names) + 2)]
    # A few columns of cells at a time stay in the cache while fields are interleaved. Their
    # x are always the same. Cells without data are dropped by a mask, as a whole: by their indices
    # it would take four times as long.
    block = np.empty((max(1, min(BLOCK // rows, columns)), rows, len(names) + 2), FLOAT)
    block[:, :, field_of_x] = x
    cells = block.reshape(-1, len(names) + 2)
    points = cells.view(np.dtype((np.void, cells.itemsize * cells.shape[1])))[:, 0]
    chosen, data = valid.ravel("F"), array.array("B")
    for part in slices(columns, len(block)):
        count, within = part.stop - part.start, slice(part.start * rows, part.stop * rows)
        block[:count, :, field_of_x + 1] = y[part, None]
        for field, layer in zip(fields, layers, strict=True):
            cells[: count * rows, field] = layer[within]
        data.frombytes(points[: count * rows][chosen[within]].view(np.uint8).data)
    return data


def _message(grid_map: GridMap, names: list[str], data: "array.array[int]") -> "PointCloud2":
    """Return unpadded float32 points as a message of one row."""
    messages = messages_of("sensor_msgs")
    float32 = messages.PointField.FLOAT32
    step = FLOAT.itemsize * len(names)
    fields = [
        messages.PointField(name=name, offset=offset, datatype=float32, count=1)
        for name, offset in zip(names, range(0, step, FLOAT.itemsize), strict=True)
    ]
    message = messages.PointCloud2(
        header=to_header(grid_map),
        height=1,
        width=len(data) // step,
        fields=fields,
        is_bigendian=False,
        point_step=step,
        row_step=len(data),
        is_dense=False,
    )
    set_array(message, data)
    return message
