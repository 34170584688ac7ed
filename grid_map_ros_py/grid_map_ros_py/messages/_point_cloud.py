# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between `sensor_msgs/PointCloud2`, grid maps and arrays."""

import array
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py._arrays import Mask, slices
from grid_map_core_py._arrays._checks import select_layers
from grid_map_core_py._parameters import mismatch
from grid_map_core_py.conversions import from_points, rasterize
from grid_map_core_py.conversions._image_arrays import COLOR_LAYER
from grid_map_core_py.conversions._point_layers import COLOR_FIELDS
from grid_map_core_py.plugins import check

from ..errors import MessageError
from ._fields import check_fields, check_unique, from_stamp, to_header
from ._packages import messages_of, set_array

if TYPE_CHECKING:
    from sensor_msgs.msg import PointCloud2, PointField
    from std_msgs.msg import Header

AXES = ("x", "y", "z")
FLAT_LAYER = "flat"
FLOAT = np.dtype("<f4")
BLOCK = 8192
COLOR_SIZE = 4
"""Size of a packed color [bytes]."""

TYPES = dict(enumerate(map(np.dtype, ("i1", "u1", "<i2", "<u2", "<i4", "<u4", "<f4", "<f8")), 1))
"""Data types by `PointField.datatype`, from 1 (INT8) to 8 (FLOAT64)."""

_NONE: Mapping[str, str] = MappingProxyType({})


# --- from maps to clouds --------------------------------------------------------------------------


def to_point_cloud(
    grid_map: GridMap, point_layer: str, layers: Iterable[str] | None = None
) -> "PointCloud2":
    """Convert a map to a point cloud with one point per valid cell.

    A cell is valid if the point layer and all basic layers are finite. Points are in column-major
    order of the map buffer. Each layer becomes a float32 field of the same name, except:

    - The point layer becomes the three fields x, y, z [m].
    - The layer `color` becomes the field `rgb`, where viewers expect packed colors. If a layer
      `rgb` is also sent, the field is named `color`.

    Args:
        point_layer: layer with the z coordinates [m].
        layers: names of the layers to send, in this order; None means all. If the point layer is
            not listed, x, y, z are the first fields. Other layers may not be called x, y or z.
    """
    select_layers(grid_map.layers, point_layer)
    names = select_layers(grid_map.layers, layers)
    if point_layer not in names:
        names = (point_layer, *names)
    color = "color" if "rgb" in names else "rgb"
    renamed: dict[str, tuple[str, ...]] = {"color": (color,), point_layer: AXES}
    fields = [field for name in names for field in renamed.get(name, (name,))]
    for axis in AXES:
        if fields.count(axis) > 1:
            raise MessageError("fields", f"no layer called {axis!r} beside the coordinates", fields)
    valid = grid_map.valid_mask((point_layer, *grid_map.basic_layers))
    data = _interleaved(grid_map, names, point_layer, valid)
    return write_points(fields, data, to_header(grid_map))


def to_flat_point_cloud(grid_map: GridMap, height: float = 0.0) -> "PointCloud2":
    """Convert a map to a point cloud at a constant height [m], with all layers as fields.

    x, y, z are the last fields. Cells where a basic layer is not finite are omitted. A layer named
    `flat` is omitted, too, as in C++.
    """
    if not abs(height) <= float(np.finfo(np.float32).max):
        raise MessageError("height", "a finite number", height)
    flat = np.full(grid_map.size, height, dtype=np.float32, order="F")
    others = [name for name in grid_map.layers if name != FLAT_LAYER]
    return to_point_cloud(
        grid_map.with_layers({FLAT_LAYER: flat}), FLAT_LAYER, [*others, FLAT_LAYER]
    )


def _interleaved(
    grid_map: GridMap, names: tuple[str, ...], point_layer: str, valid: Mask
) -> "array.array[int]":
    """Return the fields of all valid cells as little-endian float32 bytes, cell by cell."""
    rows, columns = grid_map.size
    with np.errstate(over="ignore"):
        x, y = (axis.astype(FLOAT) for axis in grid_map.axes())
    layers = [grid_map[name].ravel("F") for name in names]
    field_of_x = names.index(point_layer)
    fields = [*range(field_of_x), *range(field_of_x + 2, len(names) + 2)]
    # Process as many columns of cells at a time as fit in the cache. A mask is faster than indices.
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


def write_points(names: Sequence[str], data: "array.array[int]", header: "Header") -> "PointCloud2":
    """Create an unorganized cloud from the little-endian float32 bytes of an array (N, fields)."""
    messages = messages_of("sensor_msgs")
    float32 = messages.PointField.FLOAT32
    step = FLOAT.itemsize * len(names)
    fields = [
        messages.PointField(name=name, offset=offset, datatype=float32, count=1)
        for name, offset in zip(names, range(0, step, FLOAT.itemsize), strict=True)
    ]
    message = messages.PointCloud2(
        header=header,
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


# --- from clouds to maps --------------------------------------------------------------------------


def from_point_cloud(
    message: "PointCloud2",
    layer: str = "elevation",
    resolution: float | None = None,
    reduction: str = "max",
    *,
    length: npt.ArrayLike | None = None,
    position: npt.ArrayLike | None = None,
    onto: GridMap | GridGeometry | None = None,
    more_layers: Mapping[str, str] = _NONE,
    fields: Iterable[str] | None = None,
    field_reductions: Mapping[str, str] = _NONE,
    min_height: float = -np.inf,
    max_height: float = np.inf,
    tight: bool = False,
) -> GridMap:
    """Create a map from a point cloud.

    Each cell contains statistics of the heights and other fields of its points. Points outside the
    map and points with NaN or infinite coordinates are ignored. The map has the frame and the
    timestamp of the cloud.

    Args:
        message: the cloud, organized or not.
        layer: name of the layer with the heights [m].
        resolution: cell size [m].
        reduction: statistic of the heights in a cell: `max`, `min`, `mean`, `median`, `first`,
            `last`, `variance` or `count`.
        onto: geometry of the result; replaces `resolution`, `length` and `position`. If `onto` is a
            map in the frame of the cloud, the result keeps its other layers.
        more_layers: statistics of the heights for additional layers, by layer name.
        fields: names of other fields that become layers; None means all fields with one number per
            point. If the cloud has no field `color`, the field `rgb` or `rgba` becomes the layer
            `color`.
        length, position, field_reductions, min_height, max_height, tight: as in
            `grid_map_core_py.from_points`.
    """
    points, columns = read_columns(message, fields)
    frame_id, timestamp = message.header.frame_id, from_stamp(message.header.stamp)
    names = layer_names(message)
    options: dict[str, Any] = {
        "layers": {layer: reduction, **more_layers},
        "fields": columns,
        "field_reductions": {names.get(name, name): r for name, r in field_reductions.items()},
        "min_height": min_height,
        "max_height": max_height,
    }
    if onto is not None:
        is_alone = resolution is None and length is None and position is None
        check(is_alone, "onto", "no resolution, length or position beside it", onto)
        if isinstance(onto, GridGeometry):
            onto = GridMap.from_geometry(onto)
        elif onto.frame_id and frame_id != onto.frame_id:
            raise MessageError("header.frame_id", f"that of the map, {onto.frame_id!r}", frame_id)
        result = rasterize(points, onto, **options)
        result.frame_id, result.timestamp = frame_id, timestamp
        return result
    if resolution is None:
        raise mismatch("resolution", "a number, or `onto` in its place", None)
    return from_points(
        points,
        resolution,
        length=length,
        position=position,
        tight=tight,
        frame_id=frame_id,
        timestamp=timestamp,
        **options,
    )


def read_points(message: "PointCloud2") -> dict[str, npt.NDArray[Any]]:
    """Return the fields of a cloud as arrays with one element per point.

    Points are in row-major order. For an organized cloud, reshape the arrays to
    `(message.height, message.width)`. The arrays are views of the message data, unless rows are
    padded.

    Returns:
        Arrays by field name. The shape is (N,), or (N, count) for `count` numbers per point.
    """
    check_layout(message)
    return {field.name: _view(message, field) for field in message.fields}


def read_columns(
    message: "PointCloud2", fields: Iterable[str] | None = None
) -> tuple[npt.NDArray[Any], dict[str, npt.NDArray[Any]]]:
    """Return the coordinates of a cloud and the fields that become layers.

    Returns:
        points: (N, 3) x, y, z [m], float32 or float64; a view of the message if possible.
        columns: field values (N,) by layer name.
    """
    check_layout(message)
    known = {field.name: (index, field) for index, field in enumerate(message.fields)}
    if fields is None:
        chosen = [f.name for f in message.fields if f.name not in AXES and f.count <= 1]
    else:
        chosen = list(dict.fromkeys((fields,) if isinstance(fields, str) else fields))
    for name in (*AXES, *chosen):
        if name not in known:
            raise MessageError("fields", f"one called {name!r}", [*known])
        index, field = known[name]
        if field.count > 1:
            raise MessageError(f"fields[{index}].count", f"1 for {name!r}", field.count)
        if name in COLOR_FIELDS and TYPES[field.datatype].itemsize != COLOR_SIZE:
            expected = "UINT32 or FLOAT32 for packed colors"
            raise MessageError(f"fields[{index}].datatype", expected, field.datatype)
    names = layer_names(message)
    columns = {names[name]: _view(message, known[name][1]) for name in chosen}
    axes = [known[name][1] for name in AXES]
    first, kind = axes[0], TYPES[axes[0].datatype]
    adjacent = all(
        (axis.datatype, axis.offset) == (first.datatype, first.offset + k * kind.itemsize)
        for k, axis in enumerate(axes)
    )
    if adjacent and kind.kind == "f":
        return _view(message, first, 3), columns
    views = [_view(message, axis) for axis in axes]
    dtype = np.result_type(np.float32, *views)
    return np.stack(views, axis=1, dtype=dtype, casting="unsafe"), columns


def layer_names(message: "PointCloud2") -> dict[str, str]:
    """Return the layer name of each field, by field name.

    The names are equal, except that `rgb`, or else `rgba`, becomes `color` if this name is free.
    """
    names = {field.name: field.name for field in message.fields}
    for color in ("rgb", "rgba"):
        if color in names and COLOR_LAYER not in names.values():
            names[color] = COLOR_LAYER
    return names


def check_layout(message: "PointCloud2") -> None:
    """Raise `MessageError` if a cloud is big-endian, or if its fields exceed the message data."""
    check_fields(message, "sensor_msgs/PointCloud2", "fields", "point_step")
    if message.is_bigendian:
        raise MessageError("is_bigendian", "False: only little-endian clouds are read", True)
    width, height, step = message.width, message.height, message.point_step
    for index, field in enumerate(message.fields):
        path = f"fields[{index}]"
        if not field.name:
            raise MessageError(f"{path}.name", "a name", field.name)
        if field.datatype not in TYPES:
            expected = f"{min(TYPES)} to {max(TYPES)} (INT8 to FLOAT64)"
            raise MessageError(f"{path}.datatype", expected, field.datatype)
        end = field.offset + max(field.count, 1) * TYPES[field.datatype].itemsize
        if end > step:
            expected = f"at least {end}, where field {field.name!r} ({path}) ends"
            raise MessageError("point_step", expected, step)
    check_unique("fields", (field.name for field in message.fields))
    if message.row_step < width * step:
        expected = f"at least {width * step} ({width} points of {step} bytes)"
        raise MessageError("row_step", expected, message.row_step)
    if len(message.data) != height * message.row_step:
        expected = f"{height * message.row_step} bytes ({height} rows of {message.row_step})"
        raise MessageError("data", expected, len(message.data))


def _view(
    message: "PointCloud2", first: "PointField", count: int | None = None
) -> npt.NDArray[Any]:
    """Return a view (N,) or (N, count) of `count` numbers per point, starting at field `first`."""
    count = first.count if count is None else count
    shape = (count,) if count > 1 else ()
    rows, dtype = (message.height, message.width), TYPES[first.datatype]
    if not message.height * message.width:
        return np.empty((0, *shape), dtype)
    steps = (message.row_step, message.point_step, *(dtype.itemsize for _ in shape))
    values = np.ndarray((*rows, *shape), dtype, message.data, first.offset, steps)
    return values.reshape(-1, *shape)
