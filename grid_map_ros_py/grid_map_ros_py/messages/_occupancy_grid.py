# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between grid maps and `nav_msgs/OccupancyGrid`."""

import array
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import as_number, slices
from grid_map_core_py.conversions._costmap import INSCRIBED, LETHAL, CostCodec

from ..errors import MessageError
from ._fields import check_fields, check_grid, float32_resolution, from_stamp, to_header
from ._packages import messages_of, set_array

if TYPE_CHECKING:
    from nav_msgs.msg import OccupancyGrid

UNKNOWN = -1
OCCUPIED = 100

OCCUPANCY_OF_COST = (1 + 97 * (np.arange(256) - 1) // 251).astype(np.int8)
OCCUPANCY_OF_COST[[0, INSCRIBED, LETHAL, 255]] = 0, OCCUPIED - 1, OCCUPIED, UNKNOWN
"""(256,) occupancy that Nav2 publishes for each cost; several costs share an occupancy."""

PIECE = 1 << 15
"""Number of cells processed at once."""

VALUES = np.arange(256).astype(np.int8).astype(np.float32)
VALUES[UNKNOWN] = np.nan
"""Layer value of each occupancy, NaN for -1; the index is the int8 occupancy viewed as uint8."""


def to_occupancy_grid(
    grid_map: GridMap,
    layer: str,
    data_min: float = np.nan,
    data_max: float = np.nan,
    *,
    codec: CostCodec | None = None,
) -> "OccupancyGrid":
    """Convert a layer to a `nav_msgs/OccupancyGrid` message.

    Args:
        data_min, data_max: layer values that become 0 (free) and 100 (occupied). They are required
            without `codec`, and must differ. Values outside this range are clamped. NaN becomes -1
            (unknown).
        codec: converts layer values to costs, in place of `data_min` and `data_max`. The message
            contains the occupancy values that Nav2 publishes for these costs. For a layer of costs,
            pass `CostRange()`.
    """
    if codec is None:
        stored = occupancies(grid_map[layer], data_min, data_max)
    else:
        stored = OCCUPANCY_OF_COST[codec.to_costs(grid_map[layer])]
    values = np.roll(stored, np.negative(grid_map.start_index), axis=(0, 1))
    # An occupancy grid starts with the cell of smallest x and y, which is the last one of a map.
    data = array.array("b", values.ravel("F")[::-1].tobytes())
    message = messages_of("nav_msgs").OccupancyGrid(header=to_header(grid_map))
    message.info.map_load_time = message.header.stamp
    message.info.resolution = float32_resolution(grid_map.resolution)
    message.info.width, message.info.height = grid_map.size
    origin = message.info.origin.position
    origin.x, origin.y = (grid_map.position - 0.5 * grid_map.length).tolist()
    set_array(message, data)
    return message


def from_occupancy_grid(message: "OccupancyGrid", layer: str) -> GridMap:
    """Create a map with one layer from an occupancy grid.

    Occupancy values are kept, except -1 (unknown), which becomes NaN. Messages store the resolution
    as float32. A resolution of 0.1 becomes exactly 0.1 in the map.
    """
    check_fields(message, "nav_msgs/OccupancyGrid", "info.width", "data")
    geometry = check_grid("info", message.info, ("width", "height"), len(message.data))
    timestamp = from_stamp(message.header.stamp)
    # An occupancy grid starts with the cell of smallest x and y, which is the last one of a map.
    values = VALUES.take(np.frombuffer(message.data, np.uint8)[::-1])
    return GridMap.from_geometry(
        geometry, frame_id=message.header.frame_id, timestamp=timestamp
    ).with_layers({layer: values.reshape(geometry.size, order="F")})


def occupancies(values: npt.ArrayLike, data_min: float, data_max: float) -> npt.NDArray[np.int8]:
    """Return the occupancy (int8) of layer values; NaN becomes -1.

    As in C++: `trunc(100 * clamp((value - data_min) / (data_max - data_min), 0, 1))` in float32.
    """
    data_min, data_max = as_number(data_min, "data_min"), as_number(data_max, "data_max")
    with np.errstate(over="ignore", invalid="ignore"):
        low, high = np.float32(data_min), np.float32(data_max)
        extent = high - low
        if not np.isfinite(extent) or extent == 0:
            expected = "two different finite float32 numbers"
            raise MessageError("data_min, data_max", expected, (data_min, data_max))
        cells = np.asarray(values, dtype=np.float32)
        flat, found = cells.ravel("F"), np.empty(cells.size, np.int8)
        # Each piece fits in the cache.
        for piece in slices(flat.size, PIECE):
            share = (flat[piece] - low) / extent
            scaled = np.clip(share, np.float32(0), np.float32(1)) * np.float32(OCCUPIED)
            found[piece] = np.where(np.isnan(scaled), np.float32(UNKNOWN), scaled)
    return found.reshape(cells.shape, order="F")
