# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/DuplicationFilter`"""

from dataclasses import dataclass

from grid_map_core_py._arrays import Layer

from .._filter import CellFilter
from ..parts._layer_filter import LayerFilter


@dataclass(frozen=True, kw_only=True)
class Duplication(CellFilter, LayerFilter):
    """Copy `input_layer` to `output_layer`.

    Attributes:
        input_layer: layer to copy.
        output_layer: layer for the copy.
    """

    def _filter(self, layer: Layer, _resolution: float) -> Layer:
        return layer.copy("F")
