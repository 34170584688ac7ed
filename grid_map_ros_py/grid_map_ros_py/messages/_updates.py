# SPDX-License-Identifier: BSD-3-Clause
"""Updates of occupancy grids and costmaps: rectangles of changed cells.

All functions take complete `nav_msgs/OccupancyGrid` or `nav2_msgs/Costmap` messages and leave them
unchanged.
"""

import array
import copy
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import numpy.typing as npt

from ..errors import MessageError
from ._fields import check_fields, check_grid, check_position
from ._packages import messages_of

if TYPE_CHECKING:
    from map_msgs.msg import OccupancyGridUpdate
    from nav2_msgs.msg import Costmap, CostmapUpdate
    from nav_msgs.msg import OccupancyGrid

GRID, COSTMAP = ("info", "width", "height"), ("metadata", "size_x", "size_y")
"""Field with the grid description, and its fields with the numbers of cells along x and y."""

TOLERANCE = 1e-6
"""Distance below which two origins are the same [cells]."""


def to_occupancy_grid_update(
    before: "OccupancyGrid", after: "OccupancyGrid"
) -> "OccupancyGridUpdate | None":
    """Return the update (`map_msgs`) that turns `before` into `after`; None if no cell differs.

    The update is the bounding rectangle of the changed cells.

    Raises:
        MessageError: the grids differ in frame, size, resolution or origin.
    """
    update = messages_of("map_msgs", "to_occupancy_grid_update").OccupancyGridUpdate()
    return _filled(update, before, after)


def to_costmap_update(before: "Costmap", after: "Costmap") -> "CostmapUpdate | None":
    """Return the update that turns one costmap into another; see `to_occupancy_grid_update`."""
    update = messages_of("nav2_msgs", "to_costmap_update").CostmapUpdate()
    return _filled(update, before, after)


def apply_update(grid: Any, update: Any) -> Any:
    """Return a grid with the cells and the header of an update.

    Args:
        grid: an `OccupancyGrid` or a `Costmap`.
        update: the `OccupancyGridUpdate` or `CostmapUpdate`.

    Raises:
        MessageError: the update has another frame, exceeds the grid, or holds a wrong number of
            cells. Nav2 ignores such updates.
    """
    names = _names(grid)
    check_fields(update, "update of this kind of grid", "x", "y", *names[1:])
    values = _cells(grid).copy()
    (height, width), x, y = values.shape, update.x, update.y
    columns, rows = (getattr(update, name) for name in names[1:])
    if update.header.frame_id != grid.header.frame_id:
        raise MessageError("header.frame_id", repr(grid.header.frame_id), update.header.frame_id)
    if not (0 <= x <= width - columns and 0 <= y <= height - rows):
        expected = f"a rectangle within {width} x {height} cells"
        raise MessageError(f"x, y, {names[1]}, {names[2]}", expected, (x, y, columns, rows))
    if len(update.data) != rows * columns:
        raise MessageError("data", f"{rows * columns} values", len(update.data))
    new = np.frombuffer(update.data, np.uint8).reshape(rows, columns)
    values[y : y + rows, x : x + columns] = new
    return with_cells(grid, values, update.header)


def is_same_grid(before: Any, after: Any) -> bool:
    """Return whether two messages have the same frame, size, resolution and origin.

    Origins may differ by the rounding errors of a map that has moved.
    """
    (*grid, origin), (*other, other_origin) = _place(before), _place(after)
    return grid == other and np.allclose(origin, other_origin, rtol=0, atol=TOLERANCE * grid[-1])


def with_cells(grid: Any, values: npt.NDArray[np.uint8], header: Any) -> Any:
    """Return a copy of a grid message with other cells, as bytes, and another header."""
    result, (field, *_) = copy.copy(grid), _names(grid)
    result.header = header
    if field == COSTMAP[0]:
        result.metadata = copy.copy(grid.metadata)
        result.metadata.update_time = header.stamp
    result.data = _as_array(values, field)
    return result


def _filled(update: Any, before: Any, after: Any) -> Any:
    if not is_same_grid(before, after):
        expected = f"the frame and grid of the first message, {_place(before)}"
        raise MessageError(_names(after)[0], expected, _place(after))
    new = _cells(after)
    x, y, columns, rows = cv2.boundingRect(cv2.compare(_cells(before), new, cv2.CMP_NE))
    if not rows:
        return None
    update.header, update.x, update.y = after.header, x, y
    for name, count in zip(_names(after)[1:], (columns, rows), strict=True):
        setattr(update, name, count)
    update.data = _as_array(new[y : y + rows, x : x + columns], _names(after)[0])
    return update


def _names(grid: Any) -> tuple[str, str, str]:
    check_fields(grid, "nav_msgs/OccupancyGrid or nav2_msgs/Costmap", "header.frame_id", "data")
    return COSTMAP if hasattr(grid, COSTMAP[0]) else GRID


def _place(grid: Any) -> tuple[Any, ...]:
    field, *sides = _names(grid)
    info = getattr(grid, field)
    size = (getattr(info, side) for side in sides)
    x, y = check_position(f"{field}.origin.position", info.origin.position)
    return grid.header.frame_id, *size, info.resolution, (x, y)


def _cells(grid: Any) -> npt.NDArray[np.uint8]:
    """Return the cells (cells along y, cells along x) as bytes, a view of the message."""
    field, *sides = _names(grid)
    info = getattr(grid, field)
    size = check_grid(field, info, (sides[0], sides[1]), len(grid.data)).size
    return np.frombuffer(grid.data, np.uint8).reshape(size[::-1])


def _as_array(values: npt.NDArray[np.uint8], field: str) -> "array.array[int]":
    data = array.array("B" if field == COSTMAP[0] else "b")
    data.frombytes(values.tobytes())
    return data
