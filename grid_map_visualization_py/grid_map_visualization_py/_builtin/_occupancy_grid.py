# SPDX-License-Identifier: BSD-3-Clause
"""Occupancy grid of a layer."""

from dataclasses import dataclass
from typing import ClassVar

from nav_msgs import msg

from grid_map_core_py import GridMap
from grid_map_core_py.errors import ConfigError
from grid_map_ros_py.errors import MessageError
from grid_map_ros_py.messages import to_occupancy_grid
from grid_map_ros_py.messages._occupancy_grid import occupancies


@dataclass(frozen=True, kw_only=True)
class OccupancyGridVisualization:
    """Show a layer as occupancy values from 0 (free) to 100 (occupied); NaN cells are unknown.

    Attributes:
        layer: layer to show.
        data_min: layer value that becomes 0 (free).
        data_max: layer value that becomes 100 (occupied); may be less than `data_min`.
    """

    message_type: ClassVar[type] = msg.OccupancyGrid

    layer: str
    data_min: float = 0.0
    data_max: float = 1.0

    def __post_init__(self) -> None:
        try:
            occupancies((), self.data_min, self.data_max)
        except MessageError as error:
            raise ConfigError(f"parameters {error}") from error

    def __call__(self, grid_map: GridMap) -> msg.OccupancyGrid:
        return to_occupancy_grid(grid_map, self.layer, self.data_min, self.data_max)
