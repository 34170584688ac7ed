# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/DeletionFilter`"""

from dataclasses import dataclass

from grid_map_core_py import GridMap

from .._filter import CellFilter, warn


@dataclass(frozen=True, kw_only=True)
class Deletion(CellFilter):
    """Remove layers, and warn about layers that do not exist.

    Attributes:
        layers: names of the layers to remove.
    """

    layers: tuple[str, ...]

    def __call__(self, grid_map: GridMap) -> GridMap:
        missing = [name for name in self.layers if name not in grid_map]
        if missing:
            warn(f"no layer {', '.join(missing)} to delete; available: {', '.join(grid_map)}")
        return grid_map.without_layers(name for name in self.layers if name in grid_map)
