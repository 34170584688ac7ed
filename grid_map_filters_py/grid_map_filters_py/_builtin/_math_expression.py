# SPDX-License-Identifier: BSD-3-Clause
"""`gridMapFilters/MathExpressionFilter`"""

from collections.abc import Container
from copy import copy
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from grid_map_core_py import GridMap
from grid_map_core_py._arrays import slices

from .._filter import WHOLE_MAP, Filter, TileOptions, in_map_order
from ..errors import ExpressionError
from ..expression import Expression
from ..parts._side_by_side import CELLS, side_by_side

if TYPE_CHECKING:
    from grid_map_core_py.tiled import TiledMap

_CELLS = 4 * CELLS
"""Number of cells per block, large enough that walking the syntax tree adds little overhead."""


@dataclass(frozen=True, kw_only=True)
class MathExpression:
    """Compute `output_layer` with a matrix expression over the layers of the map.

    If the result is a scalar, all cells get this value. A matrix result must have the map's shape.

    Attributes:
        expression: expression to evaluate, for example `0.5 * slope + roughness`.
        output_layer: layer for the result.
    """

    expression: str
    output_layer: str
    _parsed: Expression = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_parsed", Expression(self.expression))

    def reach(self, _resolution: float) -> float:
        return 0 if self._parsed.is_cellwise else WHOLE_MAP

    def why_whole_map(self, names: Container[str]) -> str:
        return self._parsed.why_whole_map(names)

    def for_tiles_of(self, tiled_map: "TiledMap", _options: TileOptions) -> Filter:
        bound = copy(self)
        object.__setattr__(bound, "_parsed", self._parsed.for_tiles_of(tiled_map))
        return bound

    @in_map_order
    def __call__(self, grid_map: GridMap) -> GridMap:
        with np.errstate(over="ignore"):
            result = self._evaluate(grid_map)
        if result.ndim and result.shape != grid_map.size:
            raise ExpressionError(
                f"{self.expression!r} gives a matrix of shape {result.shape}; "
                f"expected a scalar or the map's {grid_map.size}"
            )
        return grid_map.with_layers({self.output_layer: result})

    def _evaluate(self, grid_map: GridMap) -> npt.NDArray[np.float32]:
        names, (rows, columns) = self._parsed.names, grid_map.size
        # A layer hides a function or constant of the same name.
        is_cellwise = self._parsed.is_cellwise and not self._parsed.is_changed_by(grid_map)
        if not (is_cellwise and names and names <= set(grid_map)):
            return np.asarray(self._parsed(grid_map), dtype=np.float32)
        result = np.empty(grid_map.size, np.float32, order="F")

        def compute(part: slice) -> None:
            layers = {name: grid_map[name][:, part] for name in names}
            self._parsed.fill(result[:, part], layers)

        side_by_side(compute, slices(columns, _CELLS // rows))
        return result
