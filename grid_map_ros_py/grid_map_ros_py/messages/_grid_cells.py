# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between grid maps and `nav_msgs/GridCells`."""

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridGeometry, GridMap
from grid_map_core_py._arrays import as_number, slices
from grid_map_core_py.conversions._point_layers import fitting_geometry

from ..errors import MessageError
from ._cdr import serialize
from ._fields import (
    as_written,
    check_fields,
    check_finite,
    check_positive,
    float32_resolution,
    from_stamp,
    to_header,
)
from ._packages import messages_of

if TYPE_CHECKING:
    from nav_msgs.msg import GridCells

BLOCK = 8192
"""Number of cells processed at once."""


def to_grid_cells(grid_map: GridMap, layer: str, lower: float, upper: float) -> "GridCells":
    """Convert the cells with values between two bounds to `nav_msgs/GridCells`.

    Cells with NaN or infinite values are omitted. For large maps, `to_serialized_grid_cells` is
    faster.

    Args:
        layer: layer whose values are compared with the bounds.
        lower, upper: inclusive bounds, rounded to float32.
    """
    message = _without_cells(grid_map)
    centers = centers_between(grid_map, layer, lower, upper).tolist()
    point = messages_of("geometry_msgs").Point
    message.cells = [point(x=x, y=y, z=z) for x, y, z in centers]
    return message


def to_serialized_grid_cells(grid_map: GridMap, layer: str, lower: float, upper: float) -> bytes:
    """Return the result of `to_grid_cells` as a serialized message, which publishers accept."""
    cells = centers_between(grid_map, layer, lower, upper)
    return serialize(_without_cells(grid_map), {"cells": cells})


def from_grid_cells(
    message: "GridCells",
    layer: str,
    resolution: float | None = None,
    *,
    geometry: GridGeometry | None = None,
) -> GridMap:
    """Create a map with one layer that is 1.0 in the cells of a message and NaN elsewhere.

    Args:
        message: the cells; z is ignored.
        resolution: cell size [m]; must equal the cell width in the message, rounded to float32.
            None means the cell width; a width of 0.1 becomes exactly 0.1.
        geometry: grid of the map, such as `grid_map.geometry`; cells outside the grid are ignored.
            None means the smallest grid that covers all cells. For messages from `to_grid_cells`,
            the cells of this grid coincide with the original cells.
    """
    check_fields(message, "nav_msgs/GridCells", "cell_width", "cells")
    timestamp = from_stamp(message.header.stamp)
    side = _side(message, resolution)
    pairs = [(cell.x, cell.y) for cell in message.cells]
    centers = check_finite("cells", np.array(pairs, np.float64).reshape(-1, 2))
    if geometry is not None:
        _side(message, geometry.resolution)
    elif not len(centers):
        raise MessageError("cells", "a cell, or a geometry for the map", [])
    else:
        lower, upper = centers.min(axis=0) - 0.5 * side, centers.max(axis=0) + 0.5 * side
        geometry = fitting_geometry(lower, upper, side, hold_edges=False)
    (rows, cols), inside = geometry.cells_at(centers)
    values = np.full(geometry.size, np.nan, np.float32, order="F")
    values[rows[inside], cols[inside]] = 1.0
    return GridMap.from_geometry(
        geometry, {layer: values}, frame_id=message.header.frame_id, timestamp=timestamp
    )


def centers_between(
    grid_map: GridMap, layer: str, lower: float, upper: float
) -> npt.NDArray[np.float64]:
    """Return the centers (N, 3) [m] of cells with values between two bounds, in buffer order.

    The centers are in the map frame, and z is 0. See `to_grid_cells` for the arguments.
    """
    values = grid_map[layer].ravel("F")
    bounds = as_number(lower, "lower"), as_number(upper, "upper")
    if any(map(math.isnan, bounds)):
        raise MessageError("lower, upper", "numbers", bounds)
    with np.errstate(over="ignore"):
        low, high = map(np.float32, bounds)
    chosen = (values >= low) & (values <= high)
    chosen &= np.isfinite(values)
    rows, columns = grid_map.size
    x, y = grid_map.axes()
    # Process a few columns at a time: they fit in the cache and share one array of x.
    width = max(1, min(BLOCK // rows, columns))
    x = np.tile(x, width)
    centers = np.zeros((np.count_nonzero(chosen), 3))
    first = 0
    for part in slices(columns, width):
        cells = np.flatnonzero(chosen[part.start * rows : part.stop * rows])
        last = first + len(cells)
        centers[first:last, 0] = x[cells]
        centers[first:last, 1] = np.repeat(y[part], rows)[cells]
        first = last
    return centers


def _without_cells(grid_map: GridMap) -> "GridCells":
    side = float32_resolution(grid_map.resolution)
    cells = messages_of("nav_msgs").GridCells
    message: GridCells = cells(header=to_header(grid_map), cell_width=side, cell_height=side)
    return message


def _side(message: "GridCells", resolution: float | None) -> float:
    width = check_positive("cell_width", message.cell_width)
    side = as_written(width) if resolution is None else as_number(resolution, "resolution")
    held = as_written(float32_resolution(side))
    for name in ("cell_width", "cell_height"):
        if as_written(getattr(message, name)) != held:
            raise MessageError(name, f"the resolution {side}", getattr(message, name))
    return side
