# Copyright (c) 2026 grid_map_py contributors
# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/DuplicationFilter`"""

from dataclasses import dataclass

from grid_map_core_py import GridMap


@dataclass(frozen=True, kw_only=True)
class Duplication:
    """Copy `input_layer` to `output_layer`.

    Attributes:
        input_layer: layer to copy.
        output_layer: layer for the copy.
    """

    input_layer: str
    output_layer: str

    def __call__(self, grid_map: GridMap) -> GridMap:
        return grid_map.with_layers({self.output_layer: grid_map[self.input_layer].copy("F")})
