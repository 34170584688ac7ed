# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between grid maps and `nav2_msgs/Costmap`."""

import array
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap, conversions as costs
from grid_map_core_py._arrays import Layer
from grid_map_core_py._arrays._checks import as_numbers
from grid_map_core_py._arrays._pieces import elementwise
from grid_map_core_py.conversions import CostRange
from grid_map_core_py.conversions._costmap import FREE, LETHAL, CostCodec, Costs

from ..errors import MessageError
from ._fields import (
    as_written,
    check_fields,
    check_grid,
    check_positive,
    float32_resolution,
    from_stamp,
    to_header,
)
from ._occupancy_grid import OCCUPANCY_OF_COST, OCCUPIED, UNKNOWN, VALUES
from ._packages import messages_of

if TYPE_CHECKING:
    from nav2_msgs.msg import Costmap

COSTS = CostRange(FREE, LETHAL)
"""Codec whose layer values are the costs 0 to 254, with NaN for unknown."""


@dataclass(frozen=True, eq=False)
class _Occupancies:
    """Codec for occupancy; `costs` (102,) holds the costs of occupancy 0 to 100 and of -1."""

    costs: Costs

    def to_costs(self, values: npt.ArrayLike) -> Costs:
        """Convert occupancy (...) to costs (...) uint8; NaN and negative values become 255."""

        def convert(values: npt.NDArray[Any]) -> Costs:
            known = np.where(values >= 0, np.fmin(values, OCCUPIED), UNKNOWN)
            return self.costs[np.rint(known).astype(np.int8)]

        return elementwise(convert, np.uint8, as_numbers(values, "values"))

    def to_values(self, costs: npt.ArrayLike) -> Layer:
        """Convert costs (...) to the occupancies of Nav2, as float32; cost 255 becomes NaN."""
        return VALUES.take(OCCUPANCY_OF_COST.take(np.asarray(costs)))


def _published(occupancy: int) -> Any:
    """Return the cost that Nav2 publishes as `occupancy`."""
    # Several costs can have this occupancy; select the cost closest to a linear scale.
    same = np.flatnonzero(occupancy == OCCUPANCY_OF_COST)
    return same[np.abs(99 * same - 253 * occupancy).argmin()]


OCCUPANCIES = _Occupancies(np.array([_published(o) for o in (*range(101), UNKNOWN)], np.uint8))
"""Codec for occupancy layers (0 to 100), such as those that `from_occupancy_grid` returns.

An occupancy becomes a cost that Nav2 publishes as this occupancy, so 99 becomes 253.
"""

STATIC_LAYER = _Occupancies(np.append(LETHAL * np.arange(101) // OCCUPIED, 255).astype(np.uint8))
"""Codec with the costs of a Nav2 `StaticLayer` if `trinary_costmap` is false: 99 becomes 251."""


def to_costmap(
    grid_map: GridMap,
    layer: str,
    data_min: float = FREE,
    data_max: float = LETHAL,
    *,
    codec: CostCodec | None = None,
) -> "Costmap":
    """Convert a layer to a `nav2_msgs/Costmap` message.

    From Kilted on, `nav2_simple_commander.costmap_2d.PyCostmap2D` accepts the message. On Jazzy,
    `PyCostmap2D` accepts only an `OccupancyGrid`: use `to_occupancy_grid` with the same codec.

    Args:
        data_min, data_max: layer values that become 0 (free) and 254 (lethal). They must differ.
            Values outside this range are clamped. NaN becomes 255 (unknown).
        codec: converts layer values to costs, in place of `data_min` and `data_max`. An example is
            `OCCUPANCIES`.
    """
    messages = messages_of("nav2_msgs", "to_costmap")
    costmap = costs.to_costs(grid_map, layer, codec or CostRange(data_min, data_max))
    header = to_header(grid_map)
    metadata = messages.CostmapMetaData(
        map_load_time=header.stamp,
        update_time=header.stamp,
        layer=layer,
        resolution=float32_resolution(costmap.resolution),
        size_x=costmap.size_x,
        size_y=costmap.size_y,
    )
    metadata.origin.position.x, metadata.origin.position.y = costmap.origin_x, costmap.origin_y
    message: Costmap = messages.Costmap(header=header, metadata=metadata)
    data = array.array("B")
    data.frombytes(costmap.costmap.data)
    # The constructor would copy the data again.
    message.data = data
    return message


def from_costmap(costmap: Any, layer: str, codec: CostCodec = COSTS) -> GridMap:
    """Create a map with one layer from a costmap.

    Messages store the resolution as float32. A resolution of 0.05 becomes exactly 0.05 in the map,
    not 0.05000000074505806.

    Args:
        costmap: a `nav2_msgs/Costmap`, or a `PyCostmap2D` from nav2_simple_commander. Up to Jazzy,
            a `PyCostmap2D` contains occupancy values, which `OCCUPANCIES` converts to costs.
        codec: converts costs to layer values. The default keeps the costs, and 255 becomes NaN.
    """
    if hasattr(costmap, "metadata"):
        grid = costmap.metadata
        geometry = check_grid("metadata", grid, ("size_x", "size_y"), len(costmap.data))
        data, frame_id = np.frombuffer(costmap.data, np.uint8), costmap.header.frame_id
        resolution, x, y = geometry.resolution, grid.origin.position.x, grid.origin.position.y
        timestamp = from_stamp(costmap.header.stamp)
    else:
        check_fields(costmap, "nav2_msgs/Costmap or a PyCostmap2D", "costmap", "size_x")
        grid, data, frame_id = costmap, costmap.costmap, costmap.global_frame_id
        # Until Jazzy, the constructor reads an OccupancyGrid, which has a field `info`.
        code = getattr(type(costmap).__init__, "__code__", None)
        if code and "info" in code.co_names:
            if np.isin(data, [*range(UNKNOWN, OCCUPIED + 1), 255], invert=True).any():
                raise MessageError("costmap", "occupancies from 0 to 100, or 255", data)
            data = OCCUPANCIES.to_costs(np.asarray(data).astype(np.int8))
        resolution = as_written(check_positive("resolution", costmap.resolution))
        x, y = costmap.origin_x, costmap.origin_y
        timestamp = from_stamp(costmap.costmap_timestamp, "costmap_timestamp")
    plain = costs.Costmap(data, grid.size_x, grid.size_y, resolution, x, y, frame_id)
    return costs.from_costs(plain, layer, codec, timestamp=timestamp)
