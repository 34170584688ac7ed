# SPDX-License-Identifier: BSD-3-Clause
"""Conversions between grid maps and `nav2_msgs/Costmap`.

A cost is a byte: 0 is free, 253 inscribed, 254 lethal, 255 unknown. A codec from
`grid_map_core_py.conversions` maps costs to layer values. NaN always becomes 255 (unknown).
"""

import array
import math
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from grid_map_core_py import GridMap, conversions as costs
from grid_map_core_py.conversions import (
    CostRange,
    CostTable,
)
from grid_map_core_py.conversions._costmap import FREE, LETHAL, CostCodec

from ._fields import (
    as_float32,
    as_written,
    check_fields,
    check_grid,
    check_positive,
    from_stamp,
    to_header,
)
from ._packages import messages_of

if TYPE_CHECKING:
    from nav2_msgs.msg import Costmap

COSTS = CostRange(FREE, LETHAL)
"""Codec whose layer values are the costs 0 to 254, with NaN for unknown."""

OCCUPANCIES = CostTable(free=0, inscribed=99, lethal=100, unknown=math.nan)
"""Codec for layers of occupancies, 0 to 100, as in nav2 and `from_occupancy_grid`."""


def to_costmap(
    grid_map: GridMap,
    layer: str,
    data_min: float = FREE,
    data_max: float = LETHAL,
    *,
    codec: CostCodec | None = None,
) -> "Costmap":
    """Convert a layer to a `nav2_msgs/Costmap` message.

    `nav2_simple_commander.costmap_2d.PyCostmap2D` accepts the message.

    Args:
        grid_map: the map.
        layer: name of the layer to convert.
        data_min, data_max: layer values of cost 0 (free) and cost 254 (lethal); must differ. Values
            outside this range are clamped; NaN becomes 255.
        codec: codec that replaces `data_min` and `data_max`, for example `OCCUPANCIES`.
    """
    messages = messages_of("nav2_msgs", "to_costmap")
    costmap = costs.to_costs(grid_map, layer, codec or CostRange(data_min, data_max))
    header = to_header(grid_map)
    metadata = messages.CostmapMetaData(
        map_load_time=header.stamp,
        update_time=header.stamp,
        layer=layer,
        resolution=as_float32("resolution", costmap.resolution),
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

    The costmap stores the resolution as float32; the map gets the float64 with the same shortest
    decimal form, such as 0.05.

    Args:
        costmap: a `nav2_msgs/Costmap`, or a `PyCostmap2D` of nav2_simple_commander.
        layer: name of the layer.
        codec: converts costs to layer values; the default keeps the costs, with NaN for unknown.
    """
    if hasattr(costmap, "metadata"):
        grid = costmap.metadata
        geometry = check_grid("metadata", grid, ("size_x", "size_y"), len(costmap.data))
        data, frame_id = np.frombuffer(costmap.data, np.uint8), costmap.header.frame_id
        resolution, place = geometry.resolution, grid.origin.position
        timestamp = from_stamp(costmap.header.stamp)
    else:
        check_fields(costmap, "nav2_msgs/Costmap or a PyCostmap2D", "costmap", "size_x")
        grid, data, frame_id = costmap, costmap.costmap, costmap.global_frame_id
        resolution = as_written(check_positive("resolution", costmap.resolution))
        place = SimpleNamespace(x=costmap.origin_x, y=costmap.origin_y)
        timestamp = from_stamp(costmap.costmap_timestamp, "costmap_timestamp")
    plain = costs.Costmap(
        costmap=data,
        size_x=grid.size_x,
        size_y=grid.size_y,
        resolution=resolution,
        origin_x=place.x,
        origin_y=place.y,
        global_frame_id=frame_id,
    )
    return costs.from_costs(plain, layer, codec, timestamp=timestamp)
