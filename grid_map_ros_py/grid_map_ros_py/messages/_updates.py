# SPDX-License-Identifier: BSD-3-Clause
"""Updates of `nav_msgs/OccupancyGrid` and `nav2_msgs/Costmap`: rectangles of changed cells."""

import array
import copy
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry

from ..errors import MessageError
from ._fields import check_fields, check_grid
from ._packages import messages_of

if TYPE_CHECKING:
    from map_msgs.msg import OccupancyGridUpdate
    from nav2_msgs.msg import Costmap, CostmapUpdate
    from nav_msgs.msg import OccupancyGrid

GRID, COSTMAP = ("info", "width", "height", "b"), ("metadata", "size_x", "size_y", "B")
"""Names of the description field and of its cell counts along x and y; type code of the cells."""


def to_occupancy_grid_update(
    before: "OccupancyGrid", after: "OccupancyGrid"
) -> "OccupancyGridUpdate | None":
    """Return the update from one grid to another, or None if all cells are equal.

    The `map_msgs/OccupancyGridUpdate` covers the bounding rectangle of the changed cells.

    Raises:
        MessageError: the grids differ in frame, size, resolution or origin.
    """
    messages = messages_of("map_msgs", "to_occupancy_grid_update")
    return filled(messages.OccupancyGridUpdate(), before, after)


def to_costmap_update(before: "Costmap", after: "Costmap") -> "CostmapUpdate | None":
    """Return the update from one costmap to another; see `to_occupancy_grid_update`."""
    messages = messages_of("nav2_msgs", "to_costmap_update")
    return filled(messages.CostmapUpdate(), before, after)


def apply_update(grid: Any, update: Any) -> Any:
    """Apply an update to a copy of a grid, and return the copy with the header of the update.

    Args:
        grid: an `OccupancyGrid` or a `Costmap`.
        update: the `OccupancyGridUpdate` or `CostmapUpdate`.

    Raises:
        MessageError: the update has the wrong frame or number of cells, or extends beyond the grid.
    """
    values, _, (_, *sides, _) = _read(grid)
    check_fields(update, "update of this kind of grid", "header.frame_id", "x", "y", *sides)
    (height, width), x, y = values.shape, update.x, update.y
    columns, rows = (getattr(update, side) for side in sides)
    if update.header.frame_id != grid.header.frame_id:
        raise MessageError("header.frame_id", repr(grid.header.frame_id), update.header.frame_id)
    if not (0 <= x <= width - columns and 0 <= y <= height - rows):
        expected = f"a rectangle within {width} x {height} cells"
        raise MessageError(f"x, y, {', '.join(sides)}", expected, (x, y, columns, rows))
    if len(update.data) != rows * columns:
        raise MessageError("data", f"{rows * columns} values", len(update.data))
    values = values.copy()
    new = np.frombuffer(update.data, np.uint8).reshape(rows, columns)
    values[y : y + rows, x : x + columns] = new
    return with_cells(grid, values, update.header)


def with_cells(grid: Any, values: npt.NDArray[np.uint8], header: Any) -> Any:
    """Return a copy of a grid message with other cells (uint8) and another header."""
    field, *_, kind = _read(grid)[2]
    result = copy.copy(grid)
    setattr(result, field, copy.deepcopy(getattr(grid, field)))
    result.header, result.data = copy.deepcopy(header), array.array(kind, values.tobytes())
    return result


def is_same_grid(before: Any, after: Any) -> bool:
    """Return whether two grids have equal frame, size, resolution and origin (up to rounding)."""
    (_, one, _), (_, other, _) = _read(before), _read(after)
    if (before.header.frame_id, one.size) != (after.header.frame_id, other.size):
        return False
    shift = np.abs(one.position - other.position).max()
    return one.resolution == other.resolution and bool(shift < 1e-6 * one.resolution)


def filled(update: Any, before: Any, after: Any) -> Any:
    """Fill `update` with the changes between two grids; return None if all cells are equal."""
    (old, geometry, _), (new, other, (field, *sides, kind)) = _read(before), _read(after)
    if not is_same_grid(before, after):
        expected = f"frame and grid of the first message, {before.header.frame_id!r}, {geometry}"
        raise MessageError(field, expected, f"{after.header.frame_id!r}, {other}")
    x, y, *size = cv2.boundingRect(cv2.compare(old, new, cv2.CMP_NE))
    if not all(size):
        return None
    update.header, update.x, update.y = after.header, x, y
    for side, count in zip(sides, size, strict=True):
        setattr(update, side, count)
    update.data = array.array(kind, new[y : y + size[1], x : x + size[0]].tobytes())
    return update


def _read(grid: Any) -> tuple[npt.NDArray[np.uint8], GridGeometry, tuple[str, str, str, str]]:
    """Return a uint8 view (height, width) of the cells, the geometry, and `GRID` or `COSTMAP`."""
    names = COSTMAP if hasattr(grid, COSTMAP[0]) else GRID
    check_fields(grid, "nav_msgs/OccupancyGrid or nav2_msgs/Costmap", "data", names[0])
    geometry = check_grid(names[0], getattr(grid, names[0]), names[1:3], len(grid.data))
    return np.frombuffer(grid.data, np.uint8).reshape(geometry.size[::-1]), geometry, names
