# SPDX-License-Identifier: BSD-3-Clause
"""Cells whose value is between two thresholds."""

import math
from dataclasses import dataclass
from typing import ClassVar

from nav_msgs import msg

from grid_map_core_py import GridMap
from grid_map_core_py.plugins import check
from grid_map_ros_py.messages import to_serialized_grid_cells


@dataclass(frozen=True, kw_only=True)
class GridCellsVisualization:
    """Show the cells with finite values between two inclusive thresholds.

    Attributes:
        layer: layer with the values.
        lower_threshold: cells with lower values are not shown.
        upper_threshold: cells with higher values are not shown.
    """

    message_type: ClassVar[type] = msg.GridCells

    layer: str
    lower_threshold: float = -math.inf
    upper_threshold: float = math.inf

    def __post_init__(self) -> None:
        expected = f"at least lower_threshold ({self.lower_threshold})"
        in_order = self.lower_threshold <= self.upper_threshold
        check(in_order, "upper_threshold", expected, self.upper_threshold)

    def __call__(self, grid_map: GridMap) -> bytes:
        return to_serialized_grid_cells(
            grid_map, self.layer, self.lower_threshold, self.upper_threshold
        )
