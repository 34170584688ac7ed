# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/SetBasicLayersFilter`"""

from dataclasses import dataclass

from grid_map_core_py import GridMap
from grid_map_core_py.errors import ConfigError

from .._filter import CellFilter, warn


@dataclass(frozen=True, kw_only=True)
class SetBasicLayers(CellFilter):
    """Set the basic layers, which decide whether a cell is valid.

    A cell is valid if all basic layers are finite. Without basic layers, no cell is valid. A
    missing layer is skipped, with a warning.

    Attributes:
        layers: names of the basic layers; may be empty.
        layer: alias of `layers`, as in C++; set exactly one of the two parameters.
    """

    layers: tuple[str, ...] | None = None
    layer: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if (self.layers is None) == (self.layer is None):
            raise ConfigError("expected either 'layers' or 'layer'")

    def __call__(self, grid_map: GridMap) -> GridMap:
        wanted = [*(self.layers or ()), *(self.layer or ())]
        missing = [name for name in wanted if name not in grid_map]
        if missing:
            warn(f"no layer {', '.join(missing)} to be basic; available: {', '.join(grid_map)}")
        result = grid_map.with_layers({})
        result.basic_layers = [name for name in wanted if name in grid_map]
        return result
